"""Simulated strips: exact shapes by shooting from the tip, seen with noise that neighbours may share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult, brentq

from vto_pipeline.cloth.swatch.strip import Strip
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.units import GRAVITY

_POINTS = 100
_TABLE = 0.02  # what is seen of the strip on the table [m]
_OWN = 0.3  # share of the variance that a point has for itself, where neighbours share some


@dataclass(frozen=True)
class Cloth:
    """A fabric of known figures.

    Args:
        weight: Per area [N/m²].
        rigidity: B [N·m].
        curl: Curvature without load [1/m].
    """

    weight: float
    rigidity: float
    curl: float

    @property
    def bending_length(self) -> float:
        """(B / w)^(1/3) [m]."""
        return float(np.cbrt(self.rigidity / self.weight))


def any_cloth(rng: np.random.Generator) -> Cloth:
    """Return an apparel fabric: 80 to 350 g/m², a bending length of 12 to 28 mm, a curl of up to 6 1/m."""
    weight, bending_length = GRAVITY * rng.uniform(0.08, 0.35), rng.uniform(0.012, 0.028)
    return Cloth(weight, weight * bending_length**3, rng.uniform(-6.0, 6.0))


def hung(cloth: Cloth, rng: np.random.Generator, face: int, reach: float) -> Strip:
    """Return a strip of 2 to 4.5 bending lengths over an edge tilted by up to 1°, with noise of 0.3 to 0.5 mm.

    Args:
        cloth: What it is of.
        rng: Random numbers.
        face: As of `Strip`.
        reach: Length over which neighbours share noise [m]; 0: each point has its own.
    """
    overhang = cloth.bending_length * rng.uniform(2.0, 4.5)
    edge = np.radians(rng.uniform(-1.0, 1.0))
    gamma = cloth.weight * overhang**3 / cloth.rigidity
    step = overhang / (_POINTS - 1)
    table = -step * np.arange(int(_TABLE / step), 0, -1)[:, None] * (np.cos(edge), -np.sin(edge))
    free = overhang * exact_shape(gamma, face * cloth.curl * overhang, edge, _POINTS)
    points = np.concatenate([table, free])
    apart = step * np.abs(np.subtract.outer(np.arange(len(points)), np.arange(len(points))))
    shared = np.exp(-apart / reach) if reach else np.eye(len(points))
    root = np.linalg.cholesky(_OWN * np.eye(len(points)) + (1.0 - _OWN) * shared)
    noise = rng.uniform(0.3e-3, 0.5e-3) * root @ rng.standard_normal(points.shape)
    return Strip(points + noise + rng.normal(0.0, 0.05, 2), face)


def exact_shape(gamma: float, curl: float, edge: float, points: int) -> FloatArray:
    """Return points at even steps from the edge to the tip, in units of the overhang, +y up; shape (N, 2).

    Args:
        gamma: w L³ / B.
        curl: Curvature without load times the overhang.
        edge: Angle below level at the edge [rad].
        points: N.
    """

    def slopes(t: float, y: FloatArray) -> list[float]:
        return [y[1], -gamma * t * np.cos(y[0]), np.cos(y[0]), -np.sin(y[0])]

    def from_tip(angle: float, at: FloatArray | None = None) -> OptimizeResult:
        return solve_ivp(slopes, (0.0, 1.0), [angle, -curl, 0.0, 0.0], "DOP853", at, rtol=1e-10, atol=1e-12)

    def off(angle: float) -> float:
        return float(from_tip(angle).y[0, -1]) - edge

    tried = np.linspace(-1.5, 3.2, 48)
    wrong = np.array([off(angle) for angle in tried])
    last = np.flatnonzero((wrong[:-1] <= 0.0) & (wrong[1:] > 0.0))[-1]
    angle = brentq(off, tried[last], tried[last + 1], xtol=1e-12)
    across, up = from_tip(angle, np.linspace(0.0, 1.0, points)).y[2:]
    return np.column_stack([across[-1] - across, up[-1] - up])[::-1]
