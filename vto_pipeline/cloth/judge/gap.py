"""Distances of a cloth to itself."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.vector import axpy, cross, dot, load, norm, sub

_CLOSER = 0.5  # of the gap at rest: what is not that much nearer are neighbours of a flat sheet,
_LAYERS = 0.25  # unless it is nearer than this share of its size, as no neighbours are: layers, at rest too


def gaps_within(
    positions: FloatArray, rest: FloatArray, faces: IntArray, within: float
) -> tuple[NDArray[np.int64], FloatArray]:
    """Return pairs of faces that have come this near, shape (K, 2), and their gaps [m].

    A gap is the least distance of corners from faces that they lie over, and of edges that share no corner: faces that
    do share one may be folded onto each other.

    Args:
        positions, rest: Now and at rest [m], shape (V, 3).
        faces: Shape (F, 3).
        within: What is farther apart is not looked at [m].
    """
    corners = positions[faces]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    axis = int(np.argmax(np.ptp(middle, axis=0)))  # the longest way is the best to sweep along
    order = np.argsort(middle[:, axis], kind="stable")
    x, laid = np.asarray(positions, np.float64), np.asarray(rest, np.float64)
    pairs, gaps = _near(middle[order], radius[order], x, laid, faces[order], axis, within)
    return np.sort(order[pairs], axis=1), gaps


@njit(cache=True)
def _near(middle, radius, x, rest, faces, axis, within):  # type: ignore[no-untyped-def]
    """Return pairs of faces, shape (K, 2), and their gaps, shape (K,).

    Args:
        middle: Centres, sorted along the axis [m], shape (F, 3).
        radius: About them [m], shape (F,).
        x, rest: Now and at rest [m], shape (V, 3).
        faces: Shape (F, 3).
        axis: Along which to sweep.
        within: How near faces are looked for [m].
    """
    pairs, gaps = np.empty((len(faces) + 16, 2), np.int64), np.empty(len(faces) + 16)
    count, widest = 0, radius.max()
    for i in range(len(faces)):
        for j in range(i + 1, len(faces)):
            if middle[j, axis] - middle[i, axis] > within + radius[i] + widest:
                break
            apart = 0.0
            for k in range(3):
                apart += (middle[j, k] - middle[i, k]) ** 2
            if apart >= (within + radius[i] + radius[j]) ** 2:
                continue
            gap = _gap(x, faces[i], faces[j])
            if gap >= within:
                continue
            if gap >= _LAYERS * min(radius[i], radius[j]) and gap >= _CLOSER * _gap(rest, faces[i], faces[j]):
                continue
            if count == len(pairs):
                pairs, gaps = np.concatenate((pairs, np.empty_like(pairs))), np.concatenate((gaps, np.empty_like(gaps)))
            pairs[count, 0], pairs[count, 1], gaps[count] = i, j, gap
            count += 1
    return pairs[:count], gaps[:count]


@njit(cache=True)
def _gap(x, one, two):  # type: ignore[no-untyped-def]
    """Return the least distance of features of two faces that share no corner, infinite where there are none."""
    least = np.inf
    for k in range(3):
        least = min(least, _to_plane_within(x, one[k], two), _to_plane_within(x, two[k], one))
    for i in range(3):
        for j in range(3):
            least = min(least, _between(x, one[i], one[(i + 1) % 3], two[j], two[(j + 1) % 3]))
    return least


@njit(cache=True)
def _to_plane_within(x, i, face):  # type: ignore[no-untyped-def]
    """Return the distance of a point from a triangle that it projects into; infinite from others, and from its own."""
    if i in (face[0], face[1], face[2]):
        return np.inf
    p, a, b, c = load(x, i), load(x, face[0]), load(x, face[1]), load(x, face[2])
    normal = cross(sub(b, a), sub(c, a))
    length = norm(normal)
    within = length > 0.0
    for start, end in ((a, b), (b, c), (c, a)):
        within &= dot(cross(sub(end, start), sub(p, start)), normal) >= 0.0
    return abs(dot(sub(p, a), normal)) / length if within else np.inf


@njit(cache=True)
def _between(x, i, j, k, m):  # type: ignore[no-untyped-def]
    """Return the distance of segments ij and km, infinite where they share an end. Ericson 2005, section 5.1.9."""
    if i in (k, m) or j in (k, m):
        return np.inf
    a, c = load(x, i), load(x, k)
    u, v, w = sub(load(x, j), a), sub(load(x, m), c), sub(a, c)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s = _share(uv * vw - uw * vv, uu * vv - uv * uv)
    t = _share(uv * s + vw, vv)
    s = _share(uv * t - uw, uu)
    return norm(axpy(s, u, axpy(-t, v, w)))


@njit(cache=True)
def _share(part, whole):  # type: ignore[no-untyped-def]
    return min(max(part / max(whole, 2.0**-1022), 0.0), 1.0)
