"""Shorten a long loop by triangles over three points in a row: its ears.

The rim of a hole in a scan is jagged, and its teeth are what makes it long. Between them the next triangle is plain: so
the ear of the shortest new edge is taken first, as an advancing front does (Zhao, Gao & Lin 2007, "A robust
hole-filling algorithm for triangular mesh"), but only where it continues the faces on both of its sides.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.geometry.remeshing.fold import fold_to, triangle_normal
from vto_pipeline.model.arrays import FloatArray, IntArray

_BENT = 0.5  # 1 - cosine of 60 degrees: what folds more is no continuation, and may be outside of the hole


def clip_ears(
    points: FloatArray, rim_normals: FloatArray, forbidden: NDArray[np.bool_], most: int
) -> tuple[IntArray, IntArray, FloatArray]:
    """Return ears of a loop, the points that are left, and the normals beyond the edges between those.

    Args:
        points, rim_normals, forbidden: As of `triangulate_loop`.
        most: How many points may be left; there are more where no other ear is good.

    Returns:
        Triangles of shape (K, 3), points of shape (L - K,) in the order of the loop, normals of shape (L - K, 3).
    """
    ears, left, normals = _clip(points, rim_normals.copy(), forbidden, most)
    kept = np.flatnonzero(left).astype(np.int32)
    return ears, kept, normals[kept]


@njit(cache=True)
def _clip(points, normals, forbidden, most):  # type: ignore[no-untyped-def]
    count = len(points)
    before, after = np.arange(count) - 1, np.arange(count) + 1
    before[0], after[count - 1] = count - 1, 0
    left, lengths = np.ones(count, np.bool_), np.empty(count)
    ears = np.empty((max(count - most, 0), 3), np.int32)
    for i in range(count):
        lengths[i] = _new_edge(i, points, normals, forbidden, before, after)
    for taken in range(len(ears)):
        i = int(np.argmin(lengths))
        if lengths[i] == np.inf:
            return ears[:taken], left, normals
        a, b = before[i], after[i]
        ears[taken] = a, i, b
        x, y, z, _ = triangle_normal(points, a, i, b)
        normals[a, 0], normals[a, 1], normals[a, 2] = x, y, z
        after[a], before[b] = b, a
        left[i], lengths[i] = False, np.inf
        for k in (a, b):
            lengths[k] = _new_edge(k, points, normals, forbidden, before, after)
    return ears, left, normals


@njit(cache=True)
def _new_edge(i, points, normals, forbidden, before, after):  # type: ignore[no-untyped-def]
    """Return the length of the edge that the ear at a point would make, infinite where there is no good one."""
    a, b = before[i], after[i]
    if forbidden[a, b]:
        return np.inf
    x, y, z, _ = triangle_normal(points, a, i, b)
    if max(fold_to(x, y, z, normals[a]), fold_to(x, y, z, normals[i])) > _BENT:
        return np.inf
    return np.sqrt(((points[b] - points[a]) ** 2).sum())
