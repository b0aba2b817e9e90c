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


def to_metres(points: FloatArray, unit: str | None, path: Path, job: Job | None) -> FloatArray:
    """Scale points to metres.

    Args:
        points: In the file's unit, finite, shape (N, 3).
        unit: One of `units.LENGTH_M`, or None: the metric unit in which the longest side is 0.3 to 2.5 m is taken.
        path: The file, for messages.
        job: Notified of a guess.

    Returns:
        Points [m], shape (N, 3).

    Raises:
        InputError: no unit fits, or the given one gives an impossible size.
    """
    longest = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
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
    return points * LENGTH_M[guess]


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
