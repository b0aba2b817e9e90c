"""The largest part of a move that lets nothing pass through anything: each vertex goes its own share of its path."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.numerics.ccd import edge_edge_time, vertex_face_time
from vto_pipeline.numerics.distance import barycentric_point, closest_on_segments, closest_on_triangle
from vto_pipeline.numerics.vector import axpy, dot, load, norm, store, sub

_KEEP = 0.1  # share of the distance to be kept, or of that at the begin if it is less, that is left at least
_FAR_SQ = 6.25  # two vertices, each on the way at most; (2 / (1 - _KEEP))² with room for rounding
_PATIENCE = 20  # rounds after which what still hits stays where it is
_SERIAL_BELOW = 500  # pairs; starting the threads costs as much as their work


@njit(cache=True, error_model="numpy")
def collision_free_step(x, end, back, features, to_face, to_edge, reach, new):
    """Return how far each vertex may go towards its end so that no pair meets, and which pairs would have met.

    What hits goes to the moment before; since that bends other ways, all is tested again until nothing hits. Shares
    only shrink, and in the end are set to zero, so there is an end. All go straight from where they are at the start to
    a place between `back` and `end`: who may not go at all is at `back`.

    Args:
        x, end: Positions at the start, where nothing crosses, and wanted [m], shape (V, 3).
        back: Where it is safest to be, shape (V, 3): at x, where nothing else moves; else where that takes the vertex.
        features: Of the cloth, and of bodies.
        to_face, to_edge: All pairs whose swept boxes overlap, shapes (N, 2) and (M, 2).
        reach: Distance each vertex contributes to what two features keep [m], shape (V,).
        new: Which ways to look at, shape (V,); pairs of others are known not to meet.

    Returns:
        Positions [m], shape (V, 3); share of each way, shape (V,); whether each pair would have met, and whether it
        does so still, both shape (N + M,); how many pairs have a new way.
    """
    share = np.ones(len(x))
    there = end.copy()
    corners = _corners(features, to_face, to_edge)
    total = len(corners)
    due, times = np.empty(total, np.int64), np.empty(total)
    hit, stuck = np.zeros(total, np.bool_), np.zeros(total, np.bool_)
    stale = new.copy()
    looked = 0
    for turn in range(total + _PATIENCE):
        count = _find_due(corners, stale, due)
        if count >= _SERIAL_BELOW:
            _times_parallel(due[:count], corners, len(to_face), x, there, reach, times)
        else:
            for n in range(count):
                times[n] = _time(due[n] < len(to_face), corners[due[n]], x, there, reach)
        if turn == 0:
            looked = count
            for n in range(count):
                hit[due[n]] = times[n] <= 1.0
        before = share.copy()
        for n in range(count):
            if times[n] <= 1.0:
                p = due[n]
                stuck[p] = True
                for i in corners[p]:
                    stuck[p] &= before[i] == 0.0
                    share[i] = min(share[i], before[i] * times[n] if turn < _PATIENCE else 0.0)
        done = True
        for i in range(len(x)):
            stale[i] = share[i] < before[i]
            if stale[i]:
                done = False
                store(there, i, axpy(share[i], sub(load(end, i), load(back, i)), load(back, i)))
        if done:
            break
    return there, share, hit, stuck, looked


@njit(cache=True, error_model="numpy")
def _corners(features, to_face, to_edge):
    """Return the vertices of each pair, shape (N + M, 4): a vertex and a face's, or two edges'."""
    corners = np.empty((len(to_face) + len(to_edge), 4), np.int32)
    for p in range(len(to_face)):
        corners[p, 0] = to_face[p, 0]
        for s in range(3):
            corners[p, 1 + s] = features.faces[to_face[p, 1], s]
    for p in range(len(to_edge)):
        for s in range(4):
            corners[len(to_face) + p, s] = features.edges[to_edge[p, s // 2], s % 2]
    return corners


@njit(cache=True, error_model="numpy")
def _find_due(corners, stale, due):
    """Write which pairs have a path that is new, and return how many there are."""
    count = 0
    for p in range(len(corners)):
        due[count] = p  # kept or overwritten
        count += stale[corners[p, 0]] | stale[corners[p, 1]] | stale[corners[p, 2]] | stale[corners[p, 3]]
    return count


@njit(cache=True, error_model="numpy", parallel=True)
def _times_parallel(due, corners, faces, x, there, reach, times):
    for n in prange(len(due)):
        times[n] = _time(due[n] < faces, corners[due[n]], x, there, reach)


@njit(cache=True, error_model="numpy")
def _time(is_face, corners, x, there, reach):
    """Return when a pair meets, as a share of the step; infinite if it does not."""
    a, b, c, d = corners[0], corners[1], corners[2], corners[3]
    a0, b0, c0, d0 = load(x, a), load(x, b), load(x, c), load(x, d)
    a1, b1, c1, d1 = load(there, a), load(there, b), load(there, c), load(there, d)
    found = np.inf
    if _cannot_meet(is_face, (a0, b0, c0, d0), (a1, b1, c1, d1)):
        return found
    keep = _KEEP
    for _ in range(2):
        if is_face:
            found = vertex_face_time(a0, b0, c0, d0, a1, b1, c1, d1, keep)
        else:
            found = edge_edge_time(a0, b0, c0, d0, a1, b1, c1, d1, keep)
        if found > 1.0:  # most do not meet, and need not know how far apart they are
            break
        apart = _distance(is_face, a0, b0, c0, d0)
        own = max(reach[a], reach[b]) + max(reach[c], reach[d])
        if apart <= own or keep < _KEEP:
            break
        keep = _KEEP * own / apart
    return found


@njit(cache=True, error_model="numpy")
def _cannot_meet(is_face, start, end):
    """Return whether the boxes of two features are farther apart at the start than they can come nearer."""
    common = sub(end[0], start[0])
    most = 0.0
    for k in range(1, 4):
        own = sub(sub(end[k], start[k]), common)
        most = max(most, dot(own, own))
    gap_sq = 0.0
    for k in range(3):
        if is_face:
            low, high = start[0][k], start[0][k]
            other_low = min(start[1][k], start[2][k], start[3][k])
            other_high = max(start[1][k], start[2][k], start[3][k])
        else:
            low, high = min(start[0][k], start[1][k]), max(start[0][k], start[1][k])
            other_low, other_high = min(start[2][k], start[3][k]), max(start[2][k], start[3][k])
        gap = max(0.0, other_low - high, low - other_high)
        gap_sq += gap * gap
    return gap_sq > _FAR_SQ * most


@njit(cache=True, error_model="numpy")
def _distance(is_face, a, b, c, d):
    """Return the distance of vertex a from face bcd, or of edge ab from cd."""
    if is_face:
        on, _ = closest_on_triangle(a, b, c, d)
        return norm(sub(a, barycentric_point(on, b, c, d)))
    s, t = closest_on_segments(a, b, c, d)
    return norm(sub(axpy(s, sub(b, a), a), axpy(t, sub(d, c), c)))
