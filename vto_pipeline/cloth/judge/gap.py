"""How near a cloth comes to itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

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
    pairs = cKDTree(middle).query_pairs(within + 2.0 * float(radius.max()), output_type="ndarray")
    apart, at_rest = _distances(middle, pairs), _distances(rest[faces].mean(axis=1), pairs)
    pairs = pairs[(apart < within + radius[pairs].sum(axis=1)) & (apart < _CLOSER * at_rest)]
    one, two = pairs.T
    low, high = corners.min(axis=1) - within, corners.max(axis=1)
    boxes = ((low[one] <= high[two]) & (low[two] <= high[one])).all(axis=1)
    shared = (faces[one][:, :, None] == faces[two][:, None, :]).any(axis=(1, 2))
    return np.asarray(pairs[boxes & ~shared])


def _distances(points: FloatArray, pairs: NDArray[np.int64]) -> FloatArray:
    x, y, z = (points[pairs[:, 0]] - points[pairs[:, 1]]).T
    return np.asarray(np.sqrt(x * x + y * y + z * z))


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
