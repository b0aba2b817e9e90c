"""The nearest place of a surface in its own layer, where layers lie close together, as in a collar folded over.

What is put back onto the nearest place of all comes to lie in the wrong layer once it is nearer to that, and then
layers cross. In a fold the two face opposite ways: so only what faces the same way counts as near.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_APART = 0.5  # of an edge, at most, between the places that stand for the surface
_NEAREST = 12  # of them: their faces are held against each other


class Layers:
    """A surface to put points back on, each in a layer that faces as it does.

    Args:
        mesh: The surface [m].
        edge: Length of the edges whose ends are put back [m]: in the search for faces, what faces the other way is
            farther by two of them.
    """

    def __init__(self, mesh: TriangleMesh, edge: float) -> None:
        import trimesh

        self._surface, self._edge = SurfaceDistance(mesh), edge
        self._normals, self._corners = face_normals(mesh), mesh.vertices[mesh.faces]
        vertices, faces, self._face = trimesh.remesh.subdivide_to_size(
            mesh.vertices, mesh.faces, _APART * edge, max_iter=30, return_index=True
        )
        self._places = cKDTree(np.hstack([vertices[faces].mean(axis=1), edge * self._normals[self._face]]))

    def nearest(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the nearest place of each point that faces as it does, shape (N, 3); of all places, where none does.

        Args:
            points: [m], shape (N, 3).
            normals: Which way they face, unit vectors, shape (N, 3).
        """
        found = self._surface.nearest(points)
        wrong = np.einsum("ni,ni->n", self._normals[found.face], normals) < 0.0
        place = found.point.copy()
        if wrong.any():
            place[wrong] = self._among_alike(points[wrong], normals[wrong])
        return place

    def _among_alike(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        import trimesh

        _, near = self._places.query(np.hstack([points, self._edge * normals]), k=min(_NEAREST, self._places.n))
        face = self._face[near.reshape(len(points), -1)]
        many = np.repeat(points, face.shape[1], axis=0)
        place = np.asarray(trimesh.triangles.closest_point(self._corners[face.ravel()], many)).reshape(*face.shape, 3)
        best = ((place - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)
        return np.asarray(place[np.arange(len(points)), best])
