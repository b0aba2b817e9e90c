"""The unit of a file that gives none: guessed from its size, reported, and overridable."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.units import LENGTH_M

_LIKELY_M = (0.3, 2.5)  # a garment or a body, or both with a stand
_POSSIBLE_M = (0.05, 10.0)  # what a user may insist on
_GUESSED = ("m", "dm", "cm", "mm")  # apart by tens, so no two fit
_STRAY_PERCENT = 1.0  # at either end of each axis
_STRAY_SHARE = 0.5  # without strays it is less than this long
_FAR_M = 1000.0  # single precision, as glTF and Poisson have it, resolves 0.1 mm so far out


def to_metres(points: FloatArray, unit: str | None, path: Path, job: Job | None) -> FloatArray:
    """Scale points to metres.

    Args:
        points: In the file's unit, finite, shape (N, 3).
        unit: One of `units.LENGTH_M`, or None: the metric unit in which the longest side is 0.3 to 2.5 m is taken. A
            few stray points, or a floor of a few corners, do not count.
        path: The file, for messages.
        job: Notified of a guess, warned of one that leaves out strays.

    Returns:
        Points [m], shape (N, 3).

    Raises:
        InputError: no unit fits, or the given one gives an impossible size.
    """
    whole = longest = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    most = _without_strays(points) if len(points) else 0.0
    # what is too large in any unit is a room, which has far corners: no unit is found by leaving them out
    if most < _STRAY_SHARE * whole and guess_unit(most) is not None and (unit or guess_unit(whole)) is not None:
        longest = most
    if unit is not None:
        _check_unit(unit, longest, path)
        return points * LENGTH_M[unit]
    guess = guess_unit(longest)
    if guess is None:
        low, high = _LIKELY_M
        problem = f"the longest side is {longest:.4g}, which is not {low} to {high} m in any of {', '.join(_GUESSED)}"
        hint = f"give the unit; in a document: {{file: {path.name}, unit: cm}}"
        raise InputError(problem, where=str(path), hint=hint)
    if job is not None:
        override = "" if guess == "m" else "; set unit: m to override"
        job.note(f"{path.name}: unit: assumed to be {guess} (longest side {longest:.4g}){override}")
        if longest < whole:
            job.warn(
                f"{path.name}: {100 - 2 * _STRAY_PERCENT:.0f} % of the points measure {longest:.4g}, all {whole:.4g}: "
                "the unit was guessed without the others; remove what stands around, or give the unit"
            )
    return points * LENGTH_M[guess]


def near_origin(points: FloatArray, path: Path, job: Job | None) -> FloatArray:
    """Move points that lie kilometres away, as in map coordinates, near the origin by whole kilometres.

    Files that share their coordinates are moved alike, as long as they do not lie on both sides of such a step.

    Args:
        points: [m], shape (N, 3).
        path: The file, for messages.
        job: Notified of a move.

    Returns:
        Points [m], shape (N, 3): the same where they lie near.
    """
    steps = np.round(np.median(points, axis=0) / _FAR_M) if len(points) else np.zeros(3)
    if not steps.any():
        return points
    if job is not None:
        job.note(
            f"{path.name}: moved by {', '.join(f'{0.0 - step:.0f}' for step in steps)} km (x, y, z), near the origin"
        )
    return points - _FAR_M * steps


def _without_strays(points: FloatArray) -> float:
    """Return the longest side without the outermost points of each axis."""
    ends = np.percentile(points, [_STRAY_PERCENT, 100.0 - _STRAY_PERCENT], axis=0)
    return float((ends[1] - ends[0]).max())


def guess_unit(longest: float) -> str | None:
    """Return the metric unit in which a longest side suits a garment or a body, or None."""
    fitting = [unit for unit in _GUESSED if _LIKELY_M[0] <= longest * LENGTH_M[unit] <= _LIKELY_M[1]]
    return fitting[0] if fitting else None


def _check_unit(unit: str, longest: float, path: Path) -> None:
    if unit not in LENGTH_M:
        raise InputError(f"unit is {unit!r}; expected one of {', '.join(LENGTH_M)}", where=str(path))
    low, high = _POSSIBLE_M
    if not low <= longest * LENGTH_M[unit] <= high:
        guess = guess_unit(longest)
        hint = f"unit: {guess} would make it {longest * LENGTH_M[guess]:.3g} m" if guess else ""
        problem = f"with unit {unit} the longest side is {longest * LENGTH_M[unit]:.4g} m; expected {low} to {high} m"
        raise InputError(problem, where=str(path), hint=hint)
