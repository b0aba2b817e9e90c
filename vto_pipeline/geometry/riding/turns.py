"""How a surface has turned about each of its vertices since it was bound.

A triangle turns by the rotation of its deformation, with unit normals mapped to unit normals: its polar factor. A
vertex turns by the mean over its triangles, weighted by their angles there. A mean of rotations is not made a rotation
again. Where triangles turn apart it is shorter: what stands off a fold shrinks before it tears or turns over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.vector import add, axpy, cross, load, load_at, scale, sub, unit

_FLAT = 1e-12  # of the squared first edge: a triangle of less area has no direction


@dataclass(frozen=True)
class Turns:
    """A surface as it was bound.

    Args:
        faces: Shape (F, 3).
        frames: Orthonormal: along the first edge, across it, normal, shape (F, 3, 3).
        shares: Of the two edges from the first corner in the first two of these [1/m], shape (F, 4).
        weights: Of each triangle in the mean of its corners, shape (F, 3).
    """

    faces: IntArray
    frames: FloatArray
    shares: FloatArray
    weights: FloatArray

    def places(self, positions: FloatArray) -> FloatArray:
        """Return position [m] and turn, row by row, of each vertex, shape (V, 12), from positions (V, 3)."""
        places = np.zeros((len(positions), 12))
        places[:, :3] = positions
        _add_turns(places, self.faces, self.frames, self.shares, self.weights)
        return places


def turns_of(mesh: TriangleMesh) -> Turns:
    """Return what is needed to know how a mesh has turned [m]. Triangles without area count for nothing."""
    corners = mesh.vertices[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.maximum(np.linalg.norm(sides, axis=2, keepdims=True), 1e-300)
    along = sides[:, 0] / lengths[:, 0]
    normal = np.cross(sides[:, 0], -sides[:, 2])
    twice_area = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = normal / np.maximum(twice_area, 1e-300)
    flat = twice_area[:, 0] <= _FLAT * lengths[:, 0, 0] ** 2
    first, height = 1.0 / lengths[:, 0], lengths[:, 0] / np.maximum(twice_area, 1e-300)
    slope = -(sides[:, 2] * along).sum(axis=1, keepdims=True)
    shares = np.where(flat[:, None], 0.0, np.hstack([first, 0.0 * first, -slope * first * height, height]))
    unit_sides = sides / lengths
    cosines = -(unit_sides * np.roll(unit_sides, 1, axis=1)).sum(axis=2)
    angles = np.where(flat[:, None], 0.0, np.arccos(np.clip(cosines, -1.0, 1.0)))
    around = np.bincount(mesh.faces.ravel(), angles.ravel(), len(mesh.vertices))
    frames = np.ascontiguousarray(np.stack([along, np.cross(normal, along), normal], axis=1))
    return Turns(mesh.faces, frames, shares, angles / np.maximum(around[mesh.faces], 1e-300))


@njit(cache=True, error_model="numpy")
def _add_turns(places, faces, frames, shares, weights):  # type: ignore[no-untyped-def]  # typed by Numba
    for f in range(len(faces)):
        a = load(places, faces[f, 0])
        ab, ac = sub(load(places, faces[f, 1]), a), sub(load(places, faces[f, 2]), a)
        along = axpy(shares[f, 0], ab, scale(shares[f, 1], ac))
        across = axpy(shares[f, 2], ab, scale(shares[f, 3], ac))
        normal = unit(cross(ab, ac))
        along = unit(add(along, cross(across, normal)))  # of both, each turned to where the first was: polar factor
        across = cross(normal, along)
        was_along, was_across, was_normal = load_at(frames, f, 0), load_at(frames, f, 1), load_at(frames, f, 2)
        for i in range(3):
            for j in range(3):
                turn = along[i] * was_along[j] + across[i] * was_across[j] + normal[i] * was_normal[j]
                for k in range(3):
                    places[faces[f, k], 3 + 3 * i + j] += weights[f, k] * turn
