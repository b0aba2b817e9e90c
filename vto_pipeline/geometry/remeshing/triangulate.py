"""Span a closed loop of points by triangles between its own points.

Liepa 2003, "Filling holes in meshes", section 3, after Barequet and Sharir 1995: by dynamic programming a triangulation
whose worst fold is small, and of equals the smallest. It is the best one when a flat one exists, else near it. A long
loop is first shortened by its ears.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.remeshing.ears import clip_ears
from vto_pipeline.geometry.remeshing.fold import fold_to, triangle_normal
from vto_pipeline.model.arrays import FloatArray, IntArray

LONGEST = 2000
"""Points of the longest loop that is triangulated at its best, in about 16 s: the work grows with the third power."""

MOST = 10_000
"""Points of the longest loop that is shortened to that by ears: chords that are taken need the square in bytes."""

TIE = 1e-9
"""Folds that differ by less are equal."""

CHUNK = 16
"""Chords of one length that one thread works on at a time."""


def triangulate_loop(points: FloatArray, rim_normals: FloatArray, forbidden: NDArray[np.bool_]) -> IntArray:
    """Return triangles over a loop, running as the loop does, shape (L - 2, 3).

    Args:
        points: The loop in order [m], shape (L, 3).
        rim_normals: Unit normal of the face beyond the edge from point i to i + 1, turned so that it agrees with the
            new faces, shape (L, 3).
        forbidden: Chords that may not be used, symmetric, shape (L, L).

    Raises:
        GarmentError: the loop is too long, or every triangulation needs a forbidden chord.
    """
    count = len(points)
    if count > MOST:
        raise GarmentError(f"a hole has {count} edges; the most is {MOST}", hint="remesh to longer edges")
    ears, kept, normals = clip_ears(points, rim_normals, forbidden, LONGEST)
    if len(kept) > LONGEST:
        raise GarmentError(
            f"a hole of {count} edges, smooth but for {len(ears)} corners, is too long: the most is {LONGEST}",
            hint="remesh to longer edges",
        )
    fold, split = _best_splits(points[kept], normals, forbidden[np.ix_(kept, kept)])
    if not np.isfinite(fold[0, -1]):
        raise GarmentError(f"a hole of {count} edges cannot be filled without doubling an edge of the mesh")
    return np.vstack([ears, kept[_collect(split)]])


@njit(cache=True, parallel=True)
def _best_splits(points, rim_normals, forbidden):  # type: ignore[no-untyped-def]
    """Return the worst fold (1 - cosine) of the best span of i..j, and the point k that it puts on the chord ij.

    Chords of one length only need shorter ones. The tables are symmetric, so that a chord reads two rows.
    """
    count = len(points)
    fold = np.zeros((count, count))
    area = np.zeros((count, count))
    split = np.full((count, count), -1, np.int32)
    normal = np.zeros((count, count, 3))
    for i in range(count - 1):
        normal[i, i + 1], normal[i + 1, i] = rim_normals[i], rim_normals[i]
    for span in range(2, count):
        for chunk in prange(-(-(count - span) // CHUNK)):
            for i in range(chunk * CHUNK, min((chunk + 1) * CHUNK, count - span)):
                _best_split(i, i + span, points, rim_normals, forbidden, fold, area, split, normal)
    return fold, split


@njit(cache=True)
def _best_split(i, j, points, rim_normals, forbidden, fold, area, split, normal):  # type: ignore[no-untyped-def]
    """Enter the chord ij into the tables."""
    last = j - i == len(points) - 1
    best_fold, best_area, best = np.inf, np.inf, -1
    if last or not forbidden[i, j]:
        for k in range(i + 1, j):
            worst = max(fold[i, k], fold[j, k])
            if worst > best_fold or worst == np.inf:
                continue
            x, y, z, own_area = triangle_normal(points, i, k, j)
            worst = max(worst, max(fold_to(x, y, z, normal[i, k]), fold_to(x, y, z, normal[j, k])))
            if last:
                worst = max(worst, fold_to(x, y, z, rim_normals[j]))
            total = area[i, k] + area[j, k] + own_area
            if worst < best_fold - TIE or (worst < best_fold + TIE and total < best_area):
                best_fold, best_area, best = worst, total, k
    fold[i, j], area[i, j], split[i, j] = best_fold, best_area, best
    fold[j, i], area[j, i] = best_fold, best_area
    if best >= 0:
        x, y, z, _ = triangle_normal(points, i, best, j)
        for a, b in ((i, j), (j, i)):
            normal[a, b, 0], normal[a, b, 1], normal[a, b, 2] = x, y, z


@njit(cache=True)
def _collect(split):  # type: ignore[no-untyped-def]
    """Return the triangles of the best span of the whole loop."""
    count = len(split)
    faces = np.empty((count - 2, 3), np.int32)
    stack = np.empty((2 * count, 2), np.int32)
    stack[0, 0], stack[0, 1] = 0, count - 1
    open_spans, filled = 1, 0
    while open_spans > 0:
        open_spans -= 1
        i, j = stack[open_spans]
        if j - i < 2:
            continue
        k = split[i, j]
        faces[filled, 0], faces[filled, 1], faces[filled, 2] = i, k, j
        filled += 1
        stack[open_spans, 0], stack[open_spans, 1] = i, k
        stack[open_spans + 1, 0], stack[open_spans + 1, 1] = k, j
        open_spans += 2
    return faces
