"""The few measures that the sample patterns are drawn from, taken off a body of any origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_LEVELS = {"chest": (0.70, 0.76), "waist": (0.57, 0.67), "hip": (0.46, 0.55)}  # shares of the stature
_MOST = (("chest", np.nanmax), ("waist", np.nanmin), ("hip", np.nanmax))
_STEP = 0.01
_BESIDE = 0.13  # m: what is farther from the middle is an arm
_WIDE = 0.28  # of the stature: what is wider has arms


@dataclass(frozen=True)
class Tape:
    """Measures of a body [m].

    Args:
        stature: Height.
        chest, waist, hip: Girths.
    """

    stature: float
    chest: float
    waist: float
    hip: float


def tape_of(body: TriangleMesh) -> Tape:
    """Return the measures of an upright body: its waist is the least girth of the trunk, the others are the largest.

    Args:
        body: Closed [m], +Y up, arms off the trunk.
    """
    low, high = float(body.vertices[:, 1].min()), float(body.vertices[:, 1].max())

    def girths(name: str) -> list[float]:
        start, end = _LEVELS[name]
        return [_girth(body, low + share * (high - low)) for share in np.arange(start, end, _STEP)]

    return Tape(high - low, *(float(f(girths(n))) for n, f in _MOST))


def _girth(body: TriangleMesh, height: float) -> float:
    """Return the length of a taut tape about the trunk at a height, arms left out [m]."""
    import trimesh

    middle = np.median(body.vertices, axis=0)
    cut = trimesh.Trimesh(body.vertices, body.faces, process=False).section([0, 1, 0], [0, height, 0])
    loops: list[FloatArray] = [] if cut is None else [loop[:, [0, 2]] for loop in cut.discrete]
    near = [loop for loop in loops if abs(loop[:, 0].mean() - middle[0]) < _BESIDE]  # both legs, if it is that low
    trunk = [loop for loop in near if np.ptp(loop[:, 0]) < _WIDE * np.ptp(body.vertices[:, 1])]  # without arms
    return float(ConvexHull(np.concatenate(trunk)).area) if trunk else np.nan  # SciPy's area is the perimeter here
