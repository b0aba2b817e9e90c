"""Points of a surface: the closest to each query, and where in its triangle a point lies."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.spatial.bvh import Bvh, build, closest_triangles

Closest: TypeAlias = tuple[IntArray, FloatArray, FloatArray]
"""Face, closest point and distance [m] of each query."""


def closest_points(points: FloatArray, vertices: FloatArray, faces: IntArray) -> Closest:
    """Return what of a surface is closest to each point (N, 3)."""
    corners, triangles = np.array(vertices, order="C"), np.array(faces, dtype=np.int32, order="C")
    return closest_in_tree(points, build(corners, triangles), corners, triangles)


def closest_in_tree(points: FloatArray, tree: Bvh, vertices: FloatArray, faces: IntArray) -> Closest:
    """Return the same where there is a tree; vertices and faces are as it was built of."""
    asked = np.array(points, order="C")  # kernels are compiled again for arrays that are read-only
    face, weights, _ = closest_triangles(tree, vertices, faces, asked, np.full(len(asked), np.inf))
    point = np.einsum("nk,nkd->nd", weights, vertices[faces[face]])
    return face, point, np.linalg.norm(asked - point, axis=1)


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the shares of a triangle's corners in a point of it, shape (N, 3) (Ericson 2004, 3.4)."""
    a, b, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    pa, pb = (p * a).sum(1), (p * b).sum(1)
    scale = aa * bb - ab * ab + 1e-30
    v, w = (bb * pa - ab * pb) / scale, (aa * pb - ab * pa) / scale
    return np.stack([1 - v - w, v, w], axis=1)
