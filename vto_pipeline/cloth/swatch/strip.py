"""A strip's profile, and what strips say of a fabric."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray

_FEWEST = 12
_SHORTEST = 0.02  # [m]


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
        """Return the strip from the edge to its tip, the lower end, with the tip on the right."""
        points = self.points if self.points[-1, 1] < self.points[0, 1] else self.points[::-1]
        side = 1.0 if points[-1, 0] >= points[0, 0] else -1.0
        return replace(self, points=points * np.array([side, 1.0]))

    def thinned(self, most: int) -> FloatArray:
        """Return at most so many points, each the mean of neighbours."""
        parts = np.array_split(self.points, min(most, len(self.points)))
        return np.array([part.mean(axis=0) for part in parts])


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
