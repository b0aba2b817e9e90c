"""Contact pairs, vertex-face or edge-edge, of cloth with itself or a body, kept apart during a step.

Two features come nearest to each other at a vertex and a face, a vertex and an edge, two vertices, or inside two edges.
A vertex and a face give all but the last; what lies on an edge or a corner of the face comes from its owner alone, so
that a fold is not held as many times as faces meet there, and not at all where the vertex is nearer to another face
that has this edge or corner: the way there is slanted, and what slides over the mesh would catch on every edge. For the
same reason what has yet to come near is seen from where it will pass, and left out where it will pass by: it is found
again, on its path as solved, by the search for what would pass through (`safe_step`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.self_collision.surface_features import Features
from vto_pipeline.numerics.distance import (
    EDGE,
    FACE,
    VERTEX,
    barycentric_point,
    closest_on_segments,
    closest_on_triangle,
)
from vto_pipeline.numerics.vector import axpy, cross, dot, load, norm, store, sub, unit

_NEARER = 0.99  # of a distance: a face that near has what the vertex comes to first
_HEAD_ON = 0.1  # of what is kept: what passes nearer than that does not pass by
_CLOSE = 1.5  # times what is kept: what is that near is held, whatever it is about to do
_PARALLEL = 1e-8  # sine squared between edges under which their nearest points mean nothing


class Pairs(NamedTuple):
    """P contacts of a cloth with itself and with bodies, sorted by key.

    Args:
        key: The same for the same features in the next step, shape (P,).
        vertices: Of the cloth, shape (P, 4).
        weights: Σ w x, with what is fixed, is the way between the two nearest points; zero for the corners of a body,
            in whose place another vertex of the pair stands. Shape (P, 4).
        normal: Unit, along that way, shape (P, 3).
        gap: What normal · way must reach [m], shape (P,).
        friction: Coulomb coefficient, shape (P,).
        fixed: What a body adds to Σ w x at the end of the step [m], shape (P, 3).
        carried: How much less it adds at the end than at the start: how far it would take the cloth [m], shape (P, 3).
    """

    key: NDArray[np.int64]
    vertices: NDArray[np.int32]
    weights: NDArray[np.float64]
    normal: NDArray[np.float64]
    gap: NDArray[np.float64]
    friction: NDArray[np.float64]
    fixed: NDArray[np.float64]
    carried: NDArray[np.float64]


class Owners(NamedTuple):
    """Which face answers for what several share.

    Args:
        of_corner: The first face at each face's corners, shape (F, 3).
        of_side: The first face at each face's edges, from corner k to k + 1, shape (F, 3).
    """

    of_corner: NDArray[np.int32]
    of_side: NDArray[np.int32]


def owners(features: Features, count: int) -> Owners:
    """Return the owners for a surface of this many vertices."""
    faces, edges = features.faces, features.edges
    face = np.arange(len(faces), dtype=np.int32)[:, None] * np.ones(3, np.int32)
    first_at, first_along = np.zeros(count, np.int32), np.zeros(len(edges), np.int32)
    for own, first in ((features.own_vertices, first_at), (features.own_edges, first_along)):
        first[own[own >= 0]] = face[own >= 0]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).astype(np.int64), axis=2)
    numbers = edges[:, 0].astype(np.int64) * count + edges[:, 1]
    side = np.searchsorted(numbers, ends[:, :, 0] * count + ends[:, :, 1])
    return Owners(first_at[faces], first_along[side])


def no_pairs() -> Pairs:
    """Return none."""
    return Pairs(
        np.empty(0, np.int64),
        np.empty((0, 4), np.int32),
        np.empty((0, 4)),
        np.empty((0, 3)),
        np.empty(0),
        np.empty(0),
        np.empty((0, 3)),
        np.empty((0, 3)),
    )


def against_bodies(
    pairs: Pairs, count: int, begin: NDArray[np.float64], end: NDArray[np.float64], friction: NDArray[np.float64]
) -> Pairs:
    """Return the pairs by the cloth's vertices alone, sorted by key.

    Args:
        pairs: Of the vertices of a cloth, then of bodies.
        count: Of the cloth's.
        begin, end: Where those of the bodies are in this step [m], shape (B, 3).
        friction: Coulomb coefficient of bodies there, shape (B,).
    """
    order = np.argsort(pairs.key)
    of_body = pairs.vertices >= count
    body = np.where(of_body, pairs.vertices - count, 0)
    share = np.where(of_body, pairs.weights, 0.0)
    own = np.take_along_axis(pairs.vertices, np.argmin(of_body, axis=1)[:, None], axis=1)
    rough = np.take_along_axis(friction[body], np.argmax(of_body, axis=1)[:, None], axis=1)[:, 0]
    return Pairs(
        pairs.key[order],
        np.where(of_body, own, pairs.vertices)[order],
        np.where(of_body, 0.0, pairs.weights)[order],
        pairs.normal[order],
        pairs.gap[order],
        np.where(of_body.any(axis=1), rough, pairs.friction)[order],
        np.einsum("ps,psk->pk", share, end[body])[order],
        np.einsum("ps,psk->pk", share, begin[body] - end[body])[order],
    )


@njit(cache=True, error_model="numpy")
def near_pairs(x, end, drift, features, owners, to_face, to_edge, reach, recovery, regained, apart, friction, coming):
    """Return those candidates that are, or come by straight paths, nearer than they may.

    Args:
        x, end: Positions at the start and where vertices would go by themselves [m], shape (V, 3).
        drift: How far by their speed alone [m], shape (V, 3).
        features, owners: Of the cloth, and of bodies.
        to_face, to_edge: Candidates, shapes (N, 2) and (M, 2), sorted.
        reach: Distance each vertex contributes to what two features keep [m], shape (V,).
        recovery: How far those already nearer may be led apart [m].
        regained: Of the gap that they have lost, at most.
        apart: How far ways may be from what they are by themselves [m].
        friction: Coulomb coefficient of each vertex, shape (V,); of a pair it is the geometric mean.
        coming: Whether to leave out what is not near yet and by its speed will pass by.
    """
    room = len(to_face) + len(to_edge)
    key, gap = np.empty(room, np.int64), np.empty(room)
    vertices, weights, normal = np.empty((room, 4), np.int32), np.empty((room, 4)), np.empty((room, 3))
    faces, edges = features.faces, features.edges
    on_faces, features_at, distance = _places(x, faces, to_face)
    count = 0
    for p in range(len(to_face)):
        v, f = to_face[p, 0], to_face[p, 1]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        on, feature = load(on_faces, p), features_at[p]
        if feature != FACE and (
            not _owns_feature(owners, faces, v, f, feature) or _is_passed(faces, to_face, features_at, distance, p)
        ):
            continue
        vertices[count, 0], vertices[count, 1], vertices[count, 2], vertices[count, 3] = v, a, b, c
        weights[count, 0], weights[count, 1], weights[count, 2], weights[count, 3] = 1.0, -on[0], -on[1], -on[2]
        own = reach[v] + min(reach[a], min(reach[b], reach[c]))
        way, comes = _sum(x, vertices[count], weights[count]), True
        if feature != FACE:
            begin = norm(way)
            way, comes = _closest_approach(way, _sum(drift, vertices[count], weights[count]), own)
            if coming and not comes and begin > _CLOSE * own:
                continue
        if _is_near(x, end, vertices[count], weights[count], way, own, recovery, regained, apart, normal, gap, count):
            key[count] = np.int64(v) * len(faces) + f
            count += 1
    first = np.int64(len(x)) * len(faces)
    for p in range(len(to_edge)):
        e, f = to_edge[p, 0], to_edge[p, 1]
        a, b, c, d = edges[e, 0], edges[e, 1], edges[f, 0], edges[f, 1]
        s, t = closest_on_segments(load(x, a), load(x, b), load(x, c), load(x, d))
        if not (0.0 < s < 1.0 and 0.0 < t < 1.0):
            continue
        u, w = sub(load(x, b), load(x, a)), sub(load(x, d), load(x, c))
        across = cross(u, w)
        if dot(across, across) <= _PARALLEL * dot(u, u) * dot(w, w):
            continue
        vertices[count, 0], vertices[count, 1], vertices[count, 2], vertices[count, 3] = a, b, c, d
        weights[count, 0], weights[count, 1], weights[count, 2], weights[count, 3] = 1.0 - s, s, t - 1.0, -t
        own = min(reach[a], reach[b]) + min(reach[c], reach[d])
        way = _sum(x, vertices[count], weights[count])
        moved = _sum(drift, vertices[count], weights[count])
        if coming and norm(way) > _CLOSE * own and not _meet_inside(way, moved, u, w, s, t):
            continue
        if _is_near(x, end, vertices[count], weights[count], way, own, recovery, regained, apart, normal, gap, count):
            key[count] = first + np.int64(e) * len(edges) + f
            count += 1
    none = np.zeros((count, 3))
    return Pairs(
        key[:count],
        vertices[:count],
        weights[:count],
        normal[:count],
        gap[:count],
        np.sqrt(friction[vertices[:count, 0]] * friction[vertices[:count, 3]]),
        none,
        none.copy(),
    )


@njit(cache=True, error_model="numpy")
def _owns_feature(owners, faces, v, f, feature):
    """Return whether face f answers for the edge or corner of it that vertex v is near; of two vertices the first."""
    if feature >= EDGE:
        owner = owners.of_side[f, feature - EDGE]
    elif faces[f, feature - VERTEX] < v:
        return False
    else:
        owner = owners.of_corner[f, feature - VERTEX]
    return owner == f or faces[owner, 0] == v or faces[owner, 1] == v or faces[owner, 2] == v


@njit(cache=True, error_model="numpy")
def _places(x, faces, to_face):
    """Return the places on faces nearest to vertices: weights (N, 3), features (N,) and distances (N,) [m]."""
    on, feature, distance = np.empty((len(to_face), 3)), np.empty(len(to_face), np.int8), np.empty(len(to_face))
    for p in range(len(to_face)):
        v, f = to_face[p, 0], to_face[p, 1]
        a, b, c = load(x, faces[f, 0]), load(x, faces[f, 1]), load(x, faces[f, 2])
        weights, feature[p] = closest_on_triangle(load(x, v), a, b, c)
        store(on, p, weights)
        distance[p] = norm(sub(load(x, v), barycentric_point(weights, a, b, c)))
    return on, feature, distance


@njit(cache=True, error_model="numpy")
def _is_passed(faces, to_face, feature, distance, p):
    """Return whether the vertex of candidate p is nearer to another face that has the edge or corner it lies on."""
    v, f = to_face[p, 0], to_face[p, 1]
    first = last = faces[f, (feature[p] - EDGE if feature[p] >= EDGE else feature[p] - VERTEX)]
    if feature[p] >= EDGE:
        last = faces[f, (feature[p] - EDGE + 1) % 3]
    start = p
    while start > 0 and to_face[start - 1, 0] == v:
        start -= 1
    for q in range(start, len(to_face)):
        if to_face[q, 0] != v:
            break
        if distance[q] < _NEARER * distance[p]:
            g = to_face[q, 1]
            has_first = faces[g, 0] == first or faces[g, 1] == first or faces[g, 2] == first
            has_last = faces[g, 0] == last or faces[g, 1] == last or faces[g, 2] == last
            if has_first and has_last:
                return True
    return False


@njit(cache=True, error_model="numpy")
def _closest_approach(way, moved, own):
    """Return the way between two points where, going on as they do, they are nearest to each other [m].

    What slides on the other side of a rim before a vertex is on its path past it, not into it. Where they meet head on
    it is the way at the start.
    """
    square = dot(moved, moved)
    share = -dot(way, moved) / square if square > 0.0 else 0.0
    nearest = axpy(min(max(share, 0.0), 1.0), moved, way)
    return nearest if norm(nearest) > _HEAD_ON * min(own, norm(way)) else way, 0.0 < share < 1.0


@njit(cache=True, error_model="numpy")
def _meet_inside(way, moved, u, w, s, t):
    """Return whether two edges, going on as they do, meet where both have their place on the other.

    Args:
        way, moved: From the nearest place on the second to that on the first, and how it will change [m].
        u, w: From end to end [m].
        s, t: The nearest places, as shares.
    """
    across = cross(u, w)
    size = norm(across)
    n = unit(across)
    towards = dot(n, moved)
    if dot(n, way) * towards >= 0.0:
        return False
    when = -dot(n, way) / towards
    if when > 1.0:
        return False
    left = axpy(when, moved, way)
    return 0.0 <= s - dot(n, cross(left, w)) / size <= 1.0 and 0.0 <= t - dot(n, cross(left, u)) / size <= 1.0


@njit(cache=True, error_model="numpy")
def _sum(x, vertices, weights):
    """Return Σ w x."""
    total = (0.0, 0.0, 0.0)
    for s in range(4):
        total = axpy(weights[s], load(x, vertices[s]), total)
    return total


@njit(cache=True, error_model="numpy")
def _is_near(x, end, vertices, weights, along, own, recovery, regained, apart, normal, gap, place):
    """Write normal, along a given way, and gap of a pair; return whether it is near enough to matter."""
    way, there = _sum(x, vertices, weights), _sum(end, vertices, weights)
    if norm(way) == 0.0:  # they cross: there is no side to keep
        return False
    n = unit(along)
    distance = dot(n, way)
    if dot(n, there) > own + apart and distance > own:
        return False
    store(normal, place, n)
    gap[place] = min(own, distance + min(recovery, regained * (own - distance)))
    return True
