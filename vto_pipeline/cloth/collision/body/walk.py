"""The nearest place of a body near by, by walking over its surface from the last one.

From a triangle to the nearest of those that share a corner with it, until none is nearer. Cloth that slides slowly is a
step or two away from its place, which costs a tenth of a search in a tree. What the walk does not reach is not found: a
sleeve stays on its arm though that passes through the trunk, where cloth between both would have no place to be.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import IntArray
from vto_pipeline.numerics.distance import barycentric_point, closest_on_triangle
from vto_pipeline.numerics.vector import dot, load, sub


def faces_around(faces: IntArray, count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the faces that hold each of V vertices: where each one's begin, (V + 1,), and all in a row, (3F,)."""
    corners = faces.reshape(-1)
    starts = np.concatenate([[0], np.cumsum(np.bincount(corners, minlength=count))])
    return starts.astype(np.int64), (np.argsort(corners, kind="stable") // 3).astype(np.int32)


@njit(cache=True, error_model="numpy")
def walk(points, guess, vertices, faces, starts, around):  # type: ignore[no-untyped-def]
    """Return triangle, barycentric weights and feature of the place each walk ends at; see `nearest.Nearest`.

    Args:
        points: [m], shape (N, 3).
        guess: Triangles to begin at, shape (N,).
        vertices, faces: The surface, shapes (V, 3) and (F, 3).
        starts, around: See `faces_around`.
    """
    triangle, weights, feature = guess.copy(), np.empty((len(points), 3)), np.empty(len(points), np.int8)
    for i in range(len(points)):
        point, t = load(points, i), guess[i]
        best, best_sq, kind = _place_on(point, t, vertices, faces)
        walks = True
        while walks:
            walks, here = False, t
            for k in range(3):
                v = faces[here, k]
                for j in range(starts[v], starts[v + 1]):
                    other, apart_sq, what = _place_on(point, around[j], vertices, faces)
                    if apart_sq < best_sq:
                        best, best_sq, kind, t, walks = other, apart_sq, what, around[j], True
        triangle[i], feature[i] = t, kind
        weights[i, 0], weights[i, 1], weights[i, 2] = best
    return triangle, weights, feature


@njit(cache=True, error_model="numpy")
def _place_on(point, t, vertices, faces):  # type: ignore[no-untyped-def]
    """Return weights of the nearest place on triangle t, its distance squared, and its feature."""
    a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
    weights, feature = closest_on_triangle(point, a, b, c)
    away = sub(point, barycentric_point(weights, a, b, c))
    return weights, dot(away, away), feature
