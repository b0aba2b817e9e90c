"""A proof that cloth cannot come near itself in a step, cheap enough to be asked before every search.

Seen along one direction, a piece of cloth all of whose triangles show the same side, and whose rim projects to simple
loops of which one runs around all others, covers no point twice: as often as it covers a point, its rim winds about
it. This generalises the curvature criterion of Volino and Magnenat-Thalmann 1994 to any rim and to a whole step.

With thickness: two points nearer than it are no farther apart in the projection. If the straight path between their
images stays on the piece, or leaves it only across corners of the rim that are open to 60° or more, there is a way in
the projection at most twice as long. But on the way from a feature to another that shares no vertex with it, the hat
functions of its vertices sum from one to zero, with a slope of at most one over the smallest altitude of a projected
triangle. So where all altitudes exceed twice the thickness, and the rim elsewhere keeps the thickness from itself, two
such features keep it too.

Subtrees of a search are not left out by such cones: the leaves of a tree in Morton order are no connected patches, and
without the rim of a patch its cone of normals proves nothing.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.self_collision.pieces import SurfaceComponents
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.planar import difference, gap_sq, least_turn, longest_sq, segment_distance
from vto_pipeline.numerics.spatial.boxes import EMPTY, box_union, boxes_overlap, load_box, store_box, swept_boxes
from vto_pipeline.numerics.vector import add, cross, dot, load, scale, store, sub, unit

_ROUNDING = 1e-9  # share of a length or an area, far above what rounding can do


class SeparationProof(NamedTuple):
    """Whether the cloth certainly stays out of its own reach, and why, or why that is not certain."""

    out: bool
    why: str


def prove_separation(
    cloth: SurfaceComponents, start: FloatArray, end: FloatArray, radius: FloatArray
) -> SeparationProof:
    """Return whether no two features without a common vertex can come nearer than their radii on straight paths.

    Args:
        cloth: Of the surface.
        start, end: Positions [m], shape (V, 3).
        radius: Half the thickness at each vertex [m], shape (V,).
    """
    if cloth.flaw:
        return SeparationProof(False, cloth.flaw)
    thickness = 2.0 * float(radius.max(initial=0.0))
    flat, way = _projected(cloth.faces, cloth.of_vertex, start, end)
    if not _shows_one_side(cloth.faces, flat, way, 2.0 * thickness):
        return SeparationProof(False, "the cloth folds, or is seen too nearly edge-on")
    if not _corners_are_open(cloth.rim, cloth.after, flat, way):
        return SeparationProof(False, "the rim has a narrow notch")
    if not _one_rim_around(cloth.faces, cloth.of_vertex, cloth.rim, cloth.loop, cloth.piece_of_loop, flat):
        return SeparationProof(False, "a piece has no rim that runs around all of it")
    if not _rim_keeps_apart(cloth.rim, cloth.of_vertex, flat, way, thickness):
        return SeparationProof(False, "the rim comes near itself")
    several = cloth.of_vertex.max(initial=0) > 0
    if several and not _pieces_keep_apart(cloth.faces, cloth.of_vertex, swept_boxes(start, end, radius)):
        return SeparationProof(False, "two pieces are near each other")
    return SeparationProof(True, "seen along one direction, no piece overlaps itself, and the pieces are far apart")


@njit(cache=True, error_model="numpy")
def _one_rim_around(faces, of_vertex, rim, loop, piece_of_loop, flat):
    """Return whether one loop of each piece runs counter-clockwise, and all others, about holes, clockwise."""
    area = np.zeros(len(piece_of_loop))
    for r in range(len(rim)):
        i, j = rim[r, 0], rim[r, 1]
        area[loop[r]] += flat[i, 0] * flat[j, 1] - flat[i, 1] * flat[j, 0]
    around = np.zeros(0 if len(of_vertex) == 0 else of_vertex.max() + 1, np.int32)
    for k in range(len(area)):
        around[piece_of_loop[k]] += area[k] > 0.0
    return (around[of_vertex[faces[:, 0]]] == 1).all()


@njit(cache=True, error_model="numpy")
def _rim_keeps_apart(rim, of_vertex, flat, way, thickness):
    """Return whether edges of a piece's rim that share no vertex stay farther apart than the thickness."""
    most_sq = 0.0
    for r in range(len(rim)):
        for i in rim[r]:
            most_sq = max(most_sq, way[i, 0] ** 2 + way[i, 1] ** 2)
    around = 0.5 * (thickness + sqrt(most_sq))
    low, high = np.empty((len(rim), 2)), np.empty((len(rim), 2))
    for r in range(len(rim)):
        i, j = rim[r, 0], rim[r, 1]
        for d in range(2):
            low[r, d], high[r, d] = min(flat[i, d], flat[j, d]) - around, max(flat[i, d], flat[j, d]) + around
    order = np.argsort(low[:, 0], kind="mergesort")
    return _stay_apart(rim[order], of_vertex, flat, way, low[order], high[order], thickness)


@njit(cache=True, error_model="numpy")
def _projected(faces, of_vertex, start, end):
    """Return each piece seen along its mean normal at half time, and its way there less what all of it have in common.

    Returns:
        Positions at half time and displacements in the step [m], both of shape (V, 2).
    """
    count = 0 if len(of_vertex) == 0 else of_vertex.max() + 1
    normal, origin, drift = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    vertices = np.zeros(count)
    for i in range(len(of_vertex)):
        piece = of_vertex[i]
        if vertices[piece] == 0.0:
            store(origin, piece, load(start, i))
        store(drift, piece, add(load(drift, piece), sub(load(end, i), load(start, i))))
        vertices[piece] += 1.0
    for t in range(len(faces)):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        a, b, c = _twice_middle(start, end, i), _twice_middle(start, end, j), _twice_middle(start, end, k)
        store(normal, of_vertex[i], add(load(normal, of_vertex[i]), cross(sub(b, a), sub(c, a))))
    across, up = np.empty((count, 3)), np.empty((count, 3))
    for piece in range(count):
        n = unit(load(normal, piece))
        side = (0.0, n[2], -n[1]) if abs(n[0]) < 0.7 else (-n[2], 0.0, n[0])
        u = unit(side)
        store(across, piece, u)
        store(up, piece, cross(n, u))
        store(drift, piece, scale(1.0 / vertices[piece], load(drift, piece)))
    flat, way = np.empty((len(of_vertex), 2)), np.empty((len(of_vertex), 2))
    for i in range(len(of_vertex)):
        piece = of_vertex[i]
        first, last = sub(load(start, i), load(origin, piece)), sub(load(end, i), load(origin, piece))
        middle, moved = scale(0.5, add(first, last)), sub(sub(last, first), load(drift, piece))
        flat[i, 0], flat[i, 1] = dot(middle, load(across, piece)), dot(middle, load(up, piece))
        way[i, 0], way[i, 1] = dot(moved, load(across, piece)), dot(moved, load(up, piece))
    return flat, way


@njit(cache=True, error_model="numpy", forceinline=True)
def _twice_middle(start, end, i):
    return add(load(start, i), load(end, i))


@njit(cache=True, error_model="numpy")
def _shows_one_side(faces, flat, way, altitude):
    """Return whether all altitudes of all projected triangles stay positive and above this one [m]."""
    for t in range(len(faces)):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        b, c = difference(flat, i, j), difference(flat, i, k)
        db, dc = difference(way, i, j), difference(way, i, k)
        a, da = (c[0] - b[0], c[1] - b[1]), (dc[0] - db[0], dc[1] - db[1])
        most_sq = max(longest_sq(a, da), longest_sq(b, db), longest_sq(c, dc))
        if not least_turn(b, db, c, dc) > altitude * sqrt(most_sq) + _ROUNDING * most_sq:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _corners_are_open(rim, after, flat, way):
    """Return whether each corner of the rim is convex, or open to 60° or more outside, all the time."""
    for r in range(len(rim)):
        i, j, k = rim[r, 0], rim[r, 1], rim[after[r], 1]
        a, da, b, db = difference(flat, i, j), difference(way, i, j), difference(flat, j, k), difference(way, j, k)
        rounding = _ROUNDING * (longest_sq(a, da) + longest_sq(b, db))
        convex = least_turn(a, da, b, db) > rounding
        if not (convex or least_turn(a, da, _turned(b), _turned(db)) > rounding):  # turns by -120° to 60°
            return False
    return True


@njit(cache=True, error_model="numpy", forceinline=True)
def _turned(a):
    """Return a turned by 120°."""
    return -0.5 * a[0] - sqrt(0.75) * a[1], sqrt(0.75) * a[0] - 0.5 * a[1]


@njit(cache=True, error_model="numpy")
def _stay_apart(rim, of_vertex, flat, way, low, high, thickness):
    """Return whether the edges stay apart; they come in the order of low[:, 0]."""
    for r in range(len(rim)):
        i, j = rim[r, 0], rim[r, 1]
        for s in range(r + 1, len(rim)):
            if low[s, 0] > high[r, 0]:
                break
            k, m = rim[s, 0], rim[s, 1]
            if low[s, 1] > high[r, 1] or low[r, 1] > high[s, 1] or of_vertex[i] != of_vertex[k]:
                continue
            if i == m or j == k:
                continue
            nearer = 0.5 * sqrt(max(gap_sq(way, i, k), gap_sq(way, i, m), gap_sq(way, j, k), gap_sq(way, j, m)))
            size = abs(high[r, 0] - low[r, 0]) + abs(high[r, 1] - low[r, 1])
            if not segment_distance(flat, i, j, k, m) - nearer > thickness + _ROUNDING * size:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _pieces_keep_apart(faces, of_vertex, boxes):
    """Return whether the boxes about the faces of each piece are apart."""
    count = 0 if len(of_vertex) == 0 else of_vertex.max() + 1
    around = np.empty((count, 6))
    for piece in range(count):
        store_box(around, piece, EMPTY)
    for t in range(len(faces)):
        piece = of_vertex[faces[t, 0]]
        for k in range(3):
            store_box(around, piece, box_union(load_box(around, piece), load_box(boxes, faces[t, k])))
    for piece in range(count):
        for other in range(piece + 1, count):
            if boxes_overlap(load_box(around, piece), around, other):
                return False
    return True
