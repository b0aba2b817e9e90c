"""Distances of a cloth to itself."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray

_CLOSER = 0.5  # of their distance at rest: pairs that are not that much nearer are neighbours of a flat sheet


def gaps_within(
    positions: FloatArray, rest: FloatArray, faces: IntArray, within: float
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return pairs of faces that share no vertex and have come this near, shape (K, 2), and their distances [m].

    Args:
        positions, rest: Now and at rest [m], shape (V, 3).
        faces: Shape (F, 3).
        within: What is farther apart is not looked at [m].
    """
    pairs = _near_pairs(positions, rest, faces, within)
    one, two = positions[faces[pairs[:, 0]]], positions[faces[pairs[:, 1]]]
    gaps = np.full(len(pairs), np.inf)
    for i in range(3):
        gaps = np.minimum(gaps, _to_plane_within(one[:, i], two))
        gaps = np.minimum(gaps, _to_plane_within(two[:, i], one))
        for j in range(3):
            gaps = np.minimum(gaps, _between(one[:, i], one[:, (i + 1) % 3], two[:, j], two[:, (j + 1) % 3]))
    near = gaps < within
    return pairs[near], gaps[near]


def _near_pairs(positions: FloatArray, rest: FloatArray, faces: IntArray, within: float) -> NDArray[np.int64]:
    """Return pairs of faces that may be so near, shape (K, 2)."""
    corners = positions[faces]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    axis = int(np.argmax(np.ptp(middle, axis=0)))  # the longest way is the best to sweep along
    order = np.argsort(middle[:, axis], kind="stable")
    laid = rest[faces[order]].mean(axis=1)
    pairs = np.sort(order[_close(middle[order], radius[order], laid, faces[order], axis, within)], axis=1)
    one, two = pairs.T
    low, high = corners.min(axis=1) - within, corners.max(axis=1)
    return np.asarray(pairs[((low[one] <= high[two]) & (low[two] <= high[one])).all(axis=1)])


@njit(cache=True)
def _close(middle, radius, rest, faces, axis, within):  # type: ignore[no-untyped-def]
    """Return pairs of faces by their circles, without neighbours in the sheet, shape (K, 2).

    Args:
        middle: Centres, sorted along the axis [m], shape (F, 3).
        radius: About them [m], shape (F,).
        rest: The centres at rest [m], shape (F, 3).
        faces: Shape (F, 3).
        axis: Along which to sweep.
        within: How near faces are looked for [m].
    """
    pairs = np.empty((len(faces) + 16, 2), np.int64)
    count, widest = 0, radius.max()
    for i in range(len(faces)):
        for j in range(i + 1, len(faces)):
            if middle[j, axis] - middle[i, axis] > within + radius[i] + widest:
                break
            apart = at_rest = 0.0
            for k in range(3):
                apart += (middle[j, k] - middle[i, k]) ** 2
                at_rest += (rest[j, k] - rest[i, k]) ** 2
            if apart >= (within + radius[i] + radius[j]) ** 2 or apart >= _CLOSER**2 * at_rest:
                continue
            shared = False
            for a in faces[i]:
                for b in faces[j]:
                    shared |= a == b
            if shared:
                continue
            if count == len(pairs):
                pairs = np.concatenate((pairs, np.empty_like(pairs)))
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return pairs[:count]


def _to_plane_within(p: FloatArray, triangle: FloatArray) -> FloatArray:
    """Return the distance of points from triangles they project into, infinite from others, shape (N,)."""
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal / np.maximum(length, np.finfo(float).tiny)[:, None]
    within = length > 0.0
    for start, end in ((a, b), (b, c), (c, a)):
        within &= np.sum(np.cross(end - start, p - start) * normal, axis=1) >= 0.0
    return np.where(within, np.abs(np.sum((p - a) * normal, axis=1)), np.inf)


def _between(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the distance of segments ab and cd, shape (N,). Ericson 2005, section 5.1.9."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (np.sum(x * y, axis=1) for x, y in ((u, u), (v, v), (u, v)))
    uw, vw = np.sum(u * w, axis=1), np.sum(v * w, axis=1)
    tiny = np.finfo(float).tiny
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv * uv, tiny), 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, tiny), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0.0, 1.0)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1))
