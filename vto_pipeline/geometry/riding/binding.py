"""Bind one mesh to another: a render mesh to a simulation mesh, a fine simulation mesh to a coarse one.

A vertex is bound to the nearest point of its triangle, and stands off it as it did when bound. That offset turns with
the surface, by the turns of the triangle's corners in the same shares as the point: bound in one triangle or the next,
it is the same across their edge. In the pose that it was bound in, the riding mesh is given back exactly.

The blend of turns is that of skinned meshes (Magnenat-Thalmann, Laperrière & Thalmann 1988), whose bones are here the
vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from vto_pipeline.geometry.riding.layers import faces_ridden
from vto_pipeline.geometry.riding.surface_walk import nearest_in_triangles
from vto_pipeline.geometry.riding.turns import Turns, turns_of
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh


@dataclass(frozen=True)
class Binding:
    """Where each vertex of the riding mesh sits on the other.

    Args:
        corners: Vertices of its triangle of the other, shape (R, 3).
        weights: Barycentric, rows sum to 1, shape (R, 3).
        offset: From that point, as it was bound [m], shape (R, 3).
        turns: The other as it was then.
    """

    corners: IntArray
    weights: FloatArray
    offset: FloatArray
    turns: Turns

    def ride(self, places: FloatArray) -> FloatArray:
        """Return the riding vertices [m], shape (R, 3), from places and turns (V, 12) of the other mesh."""
        riding = np.empty((len(self.corners), 3))
        _ride(places, self.corners, self.weights, self.offset, riding)
        return riding


def bind(rider: TriangleMesh, mesh: TriangleMesh) -> Binding:
    """Bind a mesh to the one it was made from or that was made from it.

    Args:
        rider: In the pose of `mesh` [m].
        mesh: What will move.
    """
    corners = mesh.faces[faces_ridden(rider, mesh)]
    triangles = mesh.vertices[corners]
    weights, _ = nearest_in_triangles(rider.vertices, triangles)
    offset = rider.vertices - np.einsum("nk,nkj->nj", weights, triangles)
    return Binding(corners, weights, offset, turns_of(mesh))


def apply(binding: Binding, positions: FloatArray) -> FloatArray:
    """Return the riding vertices [m], shape (R, 3), for positions of the other mesh [m], shape (V, 3)."""
    return binding.ride(binding.turns.places(positions))


@njit(cache=True, error_model="numpy", parallel=True)
def _ride(places, corners, weights, offset, riding):  # type: ignore[no-untyped-def]  # typed by Numba
    for r in prange(len(corners)):
        i, j, k = corners[r, 0], corners[r, 1], corners[r, 2]
        u, v, w = weights[r, 0], weights[r, 1], weights[r, 2]
        for axis in range(3):
            total = u * places[i, axis] + v * places[j, axis] + w * places[k, axis]
            for m in range(3):
                n = 3 + 3 * axis + m
                total += offset[r, m] * (u * places[i, n] + v * places[j, n] + w * places[k, n])
            riding[r, axis] = total
