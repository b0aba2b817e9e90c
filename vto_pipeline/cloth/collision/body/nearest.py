"""The nearest place on a triangle surface to each point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.spatial import bvh


class Nearest(NamedTuple):
    """Places on triangles.

    Args:
        triangle: -1 where none is near enough, shape (N,).
        weights: Barycentric, shape (N, 3).
        feature: As in `numerics.distance`, shape (N,).
    """

    triangle: IntArray
    weights: FloatArray
    feature: NDArray[np.int8]

    def subset(self, chosen: NDArray[np.int64] | NDArray[np.bool_]) -> Nearest:
        """Return the places of these points."""
        return Nearest(self.triangle[chosen], self.weights[chosen], self.feature[chosen])

    def with_replaced(self, chosen: NDArray[np.int64], others: Nearest) -> Nearest:
        """Return the places with others for these points."""
        triangle, weights, feature = self.triangle.copy(), self.weights.copy(), self.feature.copy()
        triangle[chosen], weights[chosen], feature[chosen] = others
        return Nearest(triangle, weights, feature)

    def points_on(self, vertices: FloatArray, faces: IntArray) -> FloatArray:
        """Return the points there [m], shape (N, 3), for vertices (V, 3) and faces (F, 3)."""
        return np.asarray(np.einsum("nk,nkd->nd", self.weights, vertices[faces[self.triangle]]))


class SurfaceTree(NamedTuple):
    """A surface and its tree, fitted.

    Args:
        vertices: [m], shape (V, 3).
        faces: Shape (F, 3).
        tree: Of these.
    """

    vertices: FloatArray
    faces: IntArray
    tree: bvh.Bvh

    def nearest(self, points: FloatArray, reach: FloatArray, guess: IntArray) -> Nearest:
        """Return the nearest places; see `bvh.closest_triangles`."""
        return Nearest(*bvh.closest_triangles(self.tree, self.vertices, self.faces, points, reach, guess))
