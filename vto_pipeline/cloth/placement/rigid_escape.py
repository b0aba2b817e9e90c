"""Rigid motion of a garment to a place where it surrounds the body.

All cloth in the body asks to come out (`way_out`), and the garment follows as one rigid piece (Chen & Medioni 1992,
"Object modelling by registration of multiple range images": distances to planes, linearised), so that no length
changes.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.placement.way_out import WayOut
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_ROUNDS = 50
_STILL = 5e-4  # m: no vertex moves farther in the last round
_HELD = 1e-3  # share of the weight of all cloth in the body that resists each motion: what nothing asks for stays away


def escape_rigidly(body: TriangleMesh, garment: TriangleMesh) -> FloatArray:
    """Return the rigidly moved garment with the least cloth inside the body.

    Args:
        body: Oriented outward [m].
        garment: Oriented throughout, outward or inward [m].

    Returns:
        Its vertices after one rotation and shift [m], shape (V, 3).
    """
    way_out, area = WayOut(body, garment), laplacian(garment)[1]
    x = garment.vertices
    for _ in range(_ROUNDS):
        buried, way, depth = way_out.wanted(x)
        if len(buried) == 0:
            break
        before, x = x, _fit_rigid_motion(x, x[buried], way, depth, area[buried])
        if np.abs(x - before).max() < _STILL:
            break
    return x


def _fit_rigid_motion(
    x: FloatArray, at: FloatArray, way: FloatArray, wanted: FloatArray, weight: FloatArray
) -> FloatArray:
    """Return the positions after the small rigid motion that best fits the target moves of points.

    Args:
        x: What moves [m], shape (V, 3).
        at, way: Some points of it [m] and the direction each is wanted to go, unit, shapes (N, 3).
        wanted: How far [m], shape (N,).
        weight: Of each in the sum of squares, shape (N,).
    """
    middle = x.mean(axis=0)
    rows = np.hstack([way, np.cross(at - middle, way)])  # how far each goes by unit shifts and turns about the middle
    spread = ((x - middle) ** 2).sum(axis=1).mean()
    held = _HELD * weight.sum() * np.repeat([1.0, spread], 3)
    motion = np.linalg.solve(rows.T @ (weight[:, None] * rows) + np.diag(held), rows.T @ (weight * wanted))
    shift, turn = motion[:3], motion[3:]
    return np.asarray(middle + shift + Rotation.from_rotvec(turn).apply(x - middle))
