"""The profile of a hanging strip from a scan of it: the view along its width, in which it is a thin line.

A strip that is straight across looks the same in every section. So of all level directions its width is the one
along which its points fall closest to one curve. From the table to the tip the strip goes ahead and down; points
are put in order by how far they are along the diagonal.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray

_STEPS = 90  # directions tried over half a turn
_PARTS = 100  # of the profile
_FEWEST = 5 * _PARTS
_THICKEST = 0.004  # of the line in which the strip is seen along its width, root mean square [m]


def scanned_profile(points: FloatArray) -> FloatArray:
    """Return the profile of a strip, from the table to its tip, +y up [m], shape (100, 2).

    Args:
        points: Of the strip alone, +Y up [m], shape (N, 3), more or less evenly spread.

    Raises:
        InputError: too few points, or no direction in which they lie on one curve.
    """
    if len(points) < _FEWEST:
        raise InputError(f"{len(points)} points on the strip; expected {_FEWEST} at least")
    centred = points - points.mean(axis=0)
    turns = np.arange(_STEPS) * np.pi / _STEPS
    best = float(turns[int(np.argmin([_thickness(centred, turn) for turn in turns]))])
    step = np.pi / _STEPS
    found = minimize_scalar(lambda turn: _thickness(centred, turn), bounds=(best - step, best + step), method="bounded")
    if found.fun > _THICKEST:
        raise InputError(
            f"the scan is not a strip that is straight across: seen along it, it is {1e3 * found.fun:.1f} mm thick",
            hint="cut the strip out of the scan, with +Y up and in metres",
        )
    ahead, across = _along_and_across(centred, float(found.x))
    return np.array([(0.5 * (a.mean() + b.mean()), 0.5 * (b.mean() - a.mean())) for a, b in _parts(ahead, across)])


def _along_and_across(points: FloatArray, turn: float) -> tuple[FloatArray, FloatArray]:
    """Return x - y and x + y of the view along a level direction, with the strip's lower end on the right."""
    x = points[:, [0, 2]] @ (np.cos(turn), np.sin(turn))
    y = points[:, 1]
    if np.polyfit(x, y, 1)[0] > 0.0:
        x = -x
    return x - y, x + y


def _parts(ahead: FloatArray, across: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    order = np.argsort(ahead, kind="stable")
    return list(zip(np.array_split(ahead[order], _PARTS), np.array_split(across[order], _PARTS), strict=True))


def _thickness(points: FloatArray, turn: float) -> float:
    """Return how thick the points' line is in a view, root mean square [m]: of each part, about a line of its own."""
    left = []
    for ahead, across in _parts(*_along_and_across(points, turn)):
        from_middle = ahead - ahead.mean()
        slope = float(from_middle @ across) / max(float(from_middle @ from_middle), 1e-12)
        left.append(across - across.mean() - slope * from_middle)
    return float(np.sqrt(np.mean(np.square(np.concatenate(left))) / 2.0))
