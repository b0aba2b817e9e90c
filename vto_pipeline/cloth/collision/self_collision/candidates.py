"""Candidate pairs: features whose swept, inflated boxes overlap in a step.

The tree gives pairs of faces; each face brings the vertices and edges it owns (`Features`), so each pair of features
comes once, and only if its own boxes overlap. Boxes are closed: without inflation no touch of straight paths is missed;
an inflation is exact up to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.self_collision.surface_features import Features
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.spatial.boxes import EMPTY, boxes_overlap, load_box, simplex_boxes, swept_boxes
from vto_pipeline.numerics.spatial.bvh import Bvh
from vto_pipeline.numerics.spatial.bvh_pairs import cross_pairs, self_pairs
from vto_pipeline.numerics.spatial.pair_lists import collect

_CHUNK = 1024  # pairs of faces a thread takes at a time
_SERIAL_BELOW = 8192  # pairs of faces; starting the threads costs as much as they save


def self_candidates(
    tree: Bvh,
    features: Features,
    start: FloatArray,
    end: FloatArray,
    radius: FloatArray,
    skip: NDArray[np.bool_] | None = None,
) -> tuple[IntArray, IntArray]:
    """Return the features of one surface that may come near each other and share no vertex.

    Args:
        tree: Over the faces, fitted by `bvh.refit_swept` to the same way and radius.
        features: Of the surface.
        start, end: Positions; each vertex moves straight between them [m], shape (V, 3).
        radius: By which each vertex's box is larger on all sides [m], shape (V,).
        skip: Vertices that take no part, nor does any edge or face at them, shape (V,).

    Returns:
        Pairs (vertex, face), shape (N, 2), and (edge, edge), the smaller first, shape (M, 2), in lexicographic order.
    """
    side = _side(tree, features, start, end, radius, skip)
    pairs = self_pairs(tree)
    to_face = np.concatenate([_vertex_faces(pairs, one, side, side, True) for one in (0, 1)])
    return _sorted(to_face), _sorted(_edge_edges(pairs, side, side, True))


def cross_candidates(
    tree: Bvh,
    features: Features,
    start: FloatArray,
    end: FloatArray,
    radius: FloatArray,
    other_tree: Bvh,
    other_features: Features,
    other_start: FloatArray,
    other_end: FloatArray,
    skip: NDArray[np.bool_] | None = None,
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the features of cloth and of another surface that may come near each other.

    Args:
        tree, features, start, end, radius, skip: Of the cloth, see `self_candidates`.
        other_tree, other_features, other_start, other_end: Of the other surface, which is not inflated. A surface at
            rest needs its tree fitted once.

    Returns:
        Pairs (vertex of the cloth, other face), (other vertex, face of the cloth) and (edge of the cloth, other edge),
        each in lexicographic order.
    """
    side = _side(tree, features, start, end, radius, skip)
    other = _side(other_tree, other_features, other_start, other_end, np.zeros(len(other_start)), None)
    pairs = cross_pairs(tree, other_tree)
    to_face, to_vertex = _vertex_faces(pairs, 0, side, other, False), _vertex_faces(pairs, 1, other, side, False)
    return _sorted(to_face), _sorted(to_vertex), _sorted(_edge_edges(pairs, side, other, False))


@njit(cache=True, error_model="numpy")
def still_overlap(features, to_face, to_edge, start, end, radius):
    """Return which pairs of features of one surface have swept, inflated boxes that overlap, shape (N + M,).

    Of candidates found for more, these are what a search for this alone would find.
    """
    boxes = swept_boxes(start, end, radius)
    faces, edges = simplex_boxes(boxes, features.faces), simplex_boxes(boxes, features.edges)
    kept = np.empty(len(to_face) + len(to_edge), np.bool_)
    for p in range(len(to_face)):
        kept[p] = boxes_overlap(load_box(boxes, to_face[p, 0]), faces, to_face[p, 1])
    for p in range(len(to_edge)):
        kept[len(to_face) + p] = boxes_overlap(load_box(edges, to_edge[p, 0]), edges, to_edge[p, 1])
    return kept


class _Side(NamedTuple):
    """The arrays of `Features`, and the boxes of vertices, edges and faces; what is skipped has an empty one."""

    faces: IntArray
    edges: IntArray
    own_vertices: IntArray
    own_edges: IntArray
    vertex_boxes: FloatArray
    edge_boxes: FloatArray
    face_boxes: FloatArray


def _side(
    tree: Bvh,
    features: Features,
    start: FloatArray,
    end: FloatArray,
    radius: FloatArray,
    skip: NDArray[np.bool_] | None,
) -> _Side:
    vertices = swept_boxes(start, end, radius)
    edges, faces = simplex_boxes(vertices, features.edges), tree.triangles
    if skip is not None:
        faces = faces.copy()
        vertices[skip] = EMPTY
        edges[skip[features.edges].any(axis=1)] = EMPTY
        faces[skip[features.faces].any(axis=1)] = EMPTY
    return _Side(*features, vertices, edges, faces)


def _vertex_faces(pairs: IntArray, side: int, one: _Side, other: _Side, same: bool) -> IntArray:
    """Return (vertex, face): vertices that the faces of one side of the pairs own, faces of the other."""
    expand = _vertices_serial if len(pairs) < _SERIAL_BELOW else _vertices_parallel
    given = (pairs, side, one.own_vertices, one.vertex_boxes, other.faces, other.face_boxes, same)
    return collect(lambda starts, found, counts: expand(*given, starts, found, counts), _chunks(pairs), _CHUNK)


def _edge_edges(pairs: IntArray, one: _Side, other: _Side, same: bool) -> IntArray:
    """Return (edge, edge) of what both faces of the pairs own; of one surface, the smaller first."""
    expand = _edges_serial if len(pairs) < _SERIAL_BELOW else _edges_parallel
    edges, others = (one.own_edges, one.edges, one.edge_boxes), (other.own_edges, other.edges, other.edge_boxes)
    given = (pairs, *edges, *others, same)
    return collect(lambda starts, found, counts: expand(*given, starts, found, counts), _chunks(pairs), 2 * _CHUNK)


def _chunks(pairs: IntArray) -> int:
    return (len(pairs) + _CHUNK - 1) // _CHUNK


def _sorted(pairs: IntArray) -> IntArray:
    """Return the pairs in lexicographic order."""
    keys = pairs[:, 0].astype(np.int64) << 32 | pairs[:, 1]
    keys.sort()
    return np.column_stack([keys >> 32, keys & 0xFFFFFFFF]).astype(np.int32)


@njit(cache=True, error_model="numpy", parallel=True)
def _vertices_parallel(pairs, side, own, vertices, faces, triangles, same, starts, found, counts):
    for c in prange(len(counts)):
        some, room = pairs[_CHUNK * c : _CHUNK * (c + 1)], found[starts[c] : starts[c + 1]]
        counts[c] = _vertices(some, side, own, vertices, faces, triangles, same, room)


@njit(cache=True, error_model="numpy")
def _vertices_serial(pairs, side, own, vertices, faces, triangles, same, starts, found, counts):
    for c in range(len(counts)):
        some, room = pairs[_CHUNK * c : _CHUNK * (c + 1)], found[starts[c] : starts[c + 1]]
        counts[c] = _vertices(some, side, own, vertices, faces, triangles, same, room)


@njit(cache=True, error_model="numpy")
def _vertices(pairs, side, own, vertices, faces, triangles, same, found):
    """Write the vertices and faces that may touch, as far as there is room, and return how many there are."""
    count = 0
    for p in range(len(pairs)):
        face = pairs[p, 1 - side]
        box = load_box(triangles, face)
        a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
        for k in range(3):
            v = own[pairs[p, side], k]
            if v < 0:
                break
            shared = (v == a) | (v == b) | (v == c)
            if count < len(found):
                found[count, 0], found[count, 1] = v, face  # kept or overwritten: a branch would be a coin toss
            count += boxes_overlap(box, vertices, v) & ~(same & shared)
    return count


@njit(cache=True, error_model="numpy", parallel=True)
def _edges_parallel(pairs, own, ends, boxes, other_own, other_ends, other_boxes, same, starts, found, counts):
    for c in prange(len(counts)):
        some, room = pairs[_CHUNK * c : _CHUNK * (c + 1)], found[starts[c] : starts[c + 1]]
        counts[c] = _edges(some, own, ends, boxes, other_own, other_ends, other_boxes, same, room)


@njit(cache=True, error_model="numpy")
def _edges_serial(pairs, own, ends, boxes, other_own, other_ends, other_boxes, same, starts, found, counts):
    for c in range(len(counts)):
        some, room = pairs[_CHUNK * c : _CHUNK * (c + 1)], found[starts[c] : starts[c + 1]]
        counts[c] = _edges(some, own, ends, boxes, other_own, other_ends, other_boxes, same, room)


@njit(cache=True, error_model="numpy")
def _edges(pairs, own, ends, boxes, other_own, other_ends, other_boxes, same, found):
    """Write the edges that may touch, as far as there is room, and return how many there are."""
    count = 0
    for p in range(len(pairs)):
        for k in range(3):
            e = own[pairs[p, 0], k]
            if e < 0:
                break
            box = load_box(boxes, e)
            a, b = ends[e, 0], ends[e, 1]
            for m in range(3):
                f = other_own[pairs[p, 1], m]
                if f < 0:
                    break
                c, d = other_ends[f, 0], other_ends[f, 1]
                shared = (a == c) | (a == d) | (b == c) | (b == d)
                if count < len(found):
                    found[count, 0], found[count, 1] = (f, e) if same and f < e else (e, f)
                count += boxes_overlap(box, other_boxes, f) & ~(same & shared)
    return count
