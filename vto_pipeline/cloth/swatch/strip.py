"""A strip's profile, and what strips say of a fabric."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray

_FEWEST = 12
_SHORTEST = 0.02  # [m]
_END = 0.15
"""An end of a strip is so much of its length."""
_UPSIDE_DOWN = np.radians(20.0)
"""A strip whose upper end is steeper than its lower one by more than this stands on its head."""


@dataclass(frozen=True)
class Strip:
    """The profile of a strip that hangs over a table's edge.

    Args:
        points: Along the strip, from the table or its edge to the tip or back, +y up [m], shape (N, 2).
        face: 1 where the fabric's face looks up, -1 where it looks down.
        name: For people.

    Raises:
        InputError: too few points, or too short.
    """

    points: FloatArray
    face: int = 1
    name: str = "strip"

    def __post_init__(self) -> None:
        if len(self.points) < _FEWEST:
            raise InputError(f"{len(self.points)} points; expected {_FEWEST} at least", where=self.name)
        if float(np.ptp(self.points, axis=0).max()) < _SHORTEST:
            hint = "is the unit right?"
            raise InputError(f"the strip is shorter than {1e3 * _SHORTEST:.0f} mm", where=self.name, hint=hint)

    def laid_right(self) -> Strip:
        """Return the strip from the edge to its tip, the lower end, with the tip on the right.

        Raises:
            InputError: it is level at the lower end and steep at the upper one, as where y counts down.
        """
        points = self.points if self.points[-1, 1] < self.points[0, 1] else self.points[::-1]
        if _steepness(points) > _steepness(points[::-1]) + _UPSIDE_DOWN:
            problem = "the strip leaves the table steeply and is level at its tip"
            raise InputError(problem, where=self.name, hint="does y count down, as pixels do? write its negative")
        side = 1.0 if points[-1, 0] >= points[0, 0] else -1.0
        return replace(self, points=points * np.array([side, 1.0]))

    def thinned(self, most: int) -> FloatArray:
        """Return at most so many points, each the mean of neighbours."""
        parts = np.array_split(self.points, min(most, len(self.points)))
        return np.array([part.mean(axis=0) for part in parts])


def _steepness(points: FloatArray) -> float:
    """Return the angle of the first end of a line (N, 2) to the level [rad]."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    last = max(int(np.searchsorted(along, _END * along[-1])), 1)
    way = np.abs(points[last] - points[0])
    return float(np.arctan2(way[1], way[0]))


@dataclass(frozen=True)
class Rigidity:
    """What strips say of a fabric.

    Args:
        rigidity: B [N·m].
        interval: Of 95 % [N·m].
        bending_length: (B / w)^(1/3) [m].
        curl: Curvature without load [1/m]; positive makes it hang more where the face looks up. None: not measured.
        curl_error: Half its interval of 95 % [1/m].
        overhangs: L of each strip [m].
        edges: Angle below level at the edge, of each strip [rad].
        residual: Root mean square of the distances from the points to the elastica [m].
        spread: Standard deviation of log B between strips; None of fewer than three.
    """

    rigidity: float
    interval: tuple[float, float]
    bending_length: float
    overhangs: tuple[float, ...]
    curl: float | None = None
    curl_error: float = 0.0
    edges: tuple[float, ...] = ()
    residual: float = 0.0
    spread: float | None = None
