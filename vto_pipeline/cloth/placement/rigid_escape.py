"""Rigid motion of a garment to a place where it surrounds the body.

Cloth in a limb does not know from its depth which side it belongs to: beyond the axis the nearest way out is the wrong
one, and a sleeve would be pinched through the arm. Its own outer face knows: cloth comes out where the body looks the
same way. All cloth in the body asks for that, and the garment follows as one rigid piece (Chen & Medioni 1992, "Object
modelling by registration of multiple range images": distances to planes, linearised), so that no length changes.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.placement.voxel_fit import close_openings
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_TURNED = 0.1  # m: how much longer a way may be for two unit normals that differ by one
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
    looks, middles = face_normals(body), body.vertices[body.faces].mean(axis=1)
    by_place_and_look = cKDTree(np.hstack([middles, _TURNED * looks]))
    surface = SurfaceDistance(body)
    outward, area = _outward(garment), laplacian(garment)[1]
    x = garment.vertices
    for _ in range(_ROUNDS):
        buried = np.flatnonzero(surface.inside(x))
        if len(buried) == 0:
            break
        own = outward * vertex_normals(TriangleMesh(x, garment.faces))[buried]
        _, face = by_place_and_look.query(np.hstack([x[buried], _TURNED * own]))
        depth = np.einsum("vi,vi->v", middles[face] - x[buried], looks[face])
        before, x = x, _fit_rigid_motion(x, x[buried], looks[face], np.maximum(depth, 0.0), area[buried])
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


def _outward(garment: TriangleMesh) -> float:
    """Return 1 where the garment's faces look outward, its openings closed, and -1 where they look inward."""
    solid = close_openings(garment)
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    return float(np.sign(np.einsum("fi,fi->", a, np.cross(b, c))))
