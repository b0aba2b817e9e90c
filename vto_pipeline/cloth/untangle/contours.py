"""Intersection contours: crossings of edges and faces, joined to curves.

Two faces that meet do so along a segment, each end of which lies where an edge of one crosses the other, or in a
vertex that both share. At a crossing the segment goes on in the next face beside that edge, so segments chain to
contours: closed ones, and open ones that end at a boundary or in a shared vertex (Baraff, Witkin & Kass 2003,
"Untangling cloth", section 4).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.geometry.intersections import segment_meets_triangle
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.vector import add, cross, dot, load, scale, sub

FREE = -1
"""In `Crossings.ends`: the segment ends in a shared vertex, not in a crossing."""


class Crossings(NamedTuple):
    """Edges that cross faces (N), and the segments between them (K).

    Args:
        edge: Its two vertices, the smaller first, shape (N, 2).
        face: The three vertices of the face it crosses, shape (N, 3).
        face_index: Which face that is, shape (N,).
        share: How far along the edge, from its first vertex, shape (N,).
        weights: Where in the face, barycentric, shape (N, 3).
        point: [m], shape (N, 3).
        normal: Of the face, unit, shape (N, 3).
        pairs: The two faces that meet in each segment, shape (K, 2).
        ends: The crossings at the ends of each segment, or FREE, shape (K, 2).
        corner: The vertex that both faces share, where a FREE segment ends [m], or nan, shape (K, 3).
    """

    edge: IntArray
    face: IntArray
    face_index: IntArray
    share: FloatArray
    weights: FloatArray
    point: FloatArray
    normal: FloatArray
    pairs: IntArray
    ends: IntArray
    corner: FloatArray


class Contours(NamedTuple):
    """Crossings in the order of the contours they lie on; each crossing lies on one at most.

    A contour lies on two sheets at once, numbered 0 and 1; an edge of the one crosses a face of the other.

    Args:
        order: Crossings, contour after contour, shape (N,).
        first: Where each contour begins in `order`, and the end of the last, shape (C + 1,).
        side: Sheet that the edge belongs to, shape (N,), in the order of `order`.
        closed: Which contours come back to their beginning, shape (C,).
    """

    order: IntArray
    first: IntArray
    side: NDArray[np.int8]
    closed: NDArray[np.bool_]


def crossings(vertices: FloatArray, faces: IntArray, pairs: IntArray) -> Crossings:
    """Return the crossings of pairs of faces that meet.

    Args:
        vertices: [m], shape (V, 3).
        faces: Shape (F, 3).
        pairs: As `geometry.intersections` finds them, shape (K, 2).
    """
    pair, slot, corner = np.nonzero(_edges_through(vertices, faces, pairs))
    through = pairs[pair, 1 - slot]
    owner = faces[pairs[pair, slot]]
    ends = np.column_stack([owner[np.arange(len(pair)), corner], owner[np.arange(len(pair)), (corner + 1) % 3]])
    keys = np.column_stack([np.sort(ends, axis=1), through])
    unique, of_key = np.unique(keys, axis=0, return_inverse=True) if len(keys) else (keys, np.empty(0, np.int64))
    edge, face_index = unique[:, :2].astype(np.int32), unique[:, 2].astype(np.int32)
    share, weights, point, normal = _places(vertices, edge, faces[face_index])
    segments = _ends(len(pairs), pair.astype(np.int32), of_key.reshape(-1).astype(np.int32), point)
    corner = _corners(vertices, faces, pairs)
    return Crossings(edge, faces[face_index], face_index, share, weights, point, normal, pairs, segments, corner)


def contours(crossing: Crossings) -> Contours:
    """Return the crossings chained to contours: open ones first."""
    count = len(crossing.point)
    flat = crossing.ends.reshape(-1)
    used = np.flatnonzero(flat >= 0)
    at = used[np.argsort(flat[used], kind="stable")]
    begins = np.searchsorted(flat[at], np.arange(count + 1)).astype(np.int32)
    order, side, first, closed = _chain(
        crossing.ends, crossing.pairs, crossing.face_index, begins, (at // 2).astype(np.int32)
    )
    return Contours(order, first, side, closed)


@njit(cache=True, error_model="numpy")
def _edges_through(vertices, faces, pairs):  # type: ignore[no-untyped-def]
    """Return whether edge j of face s of each pair meets the other face, shape (K, 2, 3)."""
    through = np.zeros((len(pairs), 2, 3), np.bool_)
    for k in range(len(pairs)):
        for s in range(2):
            one, other = faces[pairs[k, s]], faces[pairs[k, 1 - s]]
            for j in range(3):
                p, q = one[j], one[(j + 1) % 3]
                shared = False
                for m in range(3):
                    shared |= other[m] == p or other[m] == q
                if not shared:
                    through[k, s, j] = segment_meets_triangle(
                        vertices[p], vertices[q], vertices[other[0]], vertices[other[1]], vertices[other[2]]
                    )
    return through


@njit(cache=True, error_model="numpy")
def _places(vertices, edge, face):  # type: ignore[no-untyped-def]
    """Return share along the edge (N,), weights in the face (N, 3), point (N, 3) and unit normal (N, 3)."""
    count = len(edge)
    share, weights = np.empty(count), np.empty((count, 3))
    point, normal = np.empty((count, 3)), np.empty((count, 3))
    for i in range(count):
        p, q = load(vertices, edge[i, 0]), load(vertices, edge[i, 1])
        a, b, c = load(vertices, face[i, 0]), load(vertices, face[i, 1]), load(vertices, face[i, 2])
        area = cross(sub(b, a), sub(c, a))
        square = dot(area, area)
        up, down = dot(area, sub(p, a)), dot(area, sub(q, a))
        t = min(max(up / (up - down), 0.0), 1.0) if up != down else 0.5
        x = add(scale(1.0 - t, p), scale(t, q))
        if square > 0.0:
            w = max(dot(area, cross(sub(c, b), sub(x, b))) / square, 0.0)
            v = max(dot(area, cross(sub(a, c), sub(x, c))) / square, 0.0)
            u = max(dot(area, cross(sub(b, a), sub(x, a))) / square, 0.0)
            total = u + v + w
        else:
            u = v = w = total = 1.0
        share[i] = t
        weights[i, 0], weights[i, 1], weights[i, 2] = w / total, v / total, u / total
        length = max(np.sqrt(square), 1e-300)
        for d in range(3):
            point[i, d] = x[d]
            normal[i, d] = area[d] / length
    return share, weights, point, normal


@njit(cache=True, error_model="numpy")
def _corners(vertices, faces, pairs):  # type: ignore[no-untyped-def]
    corner = np.full((len(pairs), 3), np.nan)
    for k in range(len(pairs)):
        for i in range(3):
            for j in range(3):
                if faces[pairs[k, 0], i] == faces[pairs[k, 1], j]:
                    corner[k] = vertices[faces[pairs[k, 0], i]]
    return corner


@njit(cache=True, error_model="numpy")
def _ends(count, pair, crossing, point):  # type: ignore[no-untyped-def]
    """Return the two crossings of each pair, shape (K, 2); where touching makes more, the two farthest apart."""
    ends = np.full((count, 2), FREE, np.int32)
    k = 0
    while k < len(pair):
        last = k
        while last < len(pair) and pair[last] == pair[k]:
            last += 1
        ends[pair[k], 0] = crossing[k]
        farthest = -1.0
        for i in range(k, last):
            for j in range(i + 1, last):
                way = sub(load(point, crossing[j]), load(point, crossing[i]))
                if crossing[i] != crossing[j] and dot(way, way) > farthest:
                    farthest = dot(way, way)
                    ends[pair[k], 0], ends[pair[k], 1] = crossing[i], crossing[j]
        k = last
    return ends


@njit(cache=True, error_model="numpy")
def _chain(ends, pairs, face_of, begins, segment_at):  # type: ignore[no-untyped-def]
    """Walk along segments; see `Contours` for what is returned: order, side, first, closed.

    Args:
        ends, pairs, face_of: See `Crossings`.
        begins, segment_at: Segments at each crossing, as rows of a compressed table.
    """
    count = len(face_of)
    order, side = np.empty(count, np.int32), np.empty(count, np.int8)
    first, closed = np.zeros(count + 1, np.int32), np.zeros(count, np.bool_)
    walked, met = np.zeros(len(ends), np.bool_), np.zeros(count, np.bool_)
    filled = found = 0
    for closing in range(2):
        for start in range(len(ends)):
            if walked[start] or ends[start, 0] < 0:
                continue
            enter = -1  # the end that is met last
            if closing == 1 or ends[start, 1] < 0:
                enter = 0
            else:
                for e in range(2):
                    c = ends[start, e]
                    if enter < 0 and begins[c + 1] - begins[c] == 1:
                        enter = 1 - e
            if enter < 0:
                continue
            segment, slot = start, 0  # slot: which of the segment's two faces is sheet 0
            origin = ends[start, 1 - enter]
            if origin >= 0 and not met[origin]:
                order[filled], met[origin] = origin, True
                side[filled] = 0 if pairs[segment, 1] == face_of[origin] else 1
                filled += 1
            node = ends[start, enter]
            while True:
                walked[segment] = True
                if node < 0 or met[node]:
                    break
                order[filled], met[node] = node, True
                side[filled] = 0 if pairs[segment, 1 - slot] == face_of[node] else 1
                filled += 1
                following = -1
                for i in range(begins[node], begins[node + 1]):
                    if not walked[segment_at[i]]:
                        following = segment_at[i]
                        break
                if following < 0:
                    break
                crossed = 0 if pairs[following, 0] == face_of[node] else 1  # stays on its sheet
                slot = crossed if side[filled - 1] == 1 else 1 - crossed
                segment = following
                node = ends[segment, 1] if ends[segment, 0] == node else ends[segment, 0]
            if filled > first[found]:
                closed[found] = closing == 1
                found += 1
                first[found] = filled
    return order[:filled], side[:filled], first[: found + 1], closed[:found]
