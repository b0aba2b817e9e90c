"""A bounding volume hierarchy of triangles: built once, refitted when they move, queried for nearest points.

The triangles are halved by their centres, each time across the longest side of the box about these, into 2^k equal
leaves. So the tree is a heap without pointers: the children of node i are 2i+1 and 2i+2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.distance import FACE, barycentric_point, closest_on_triangle
from vto_pipeline.numerics.spatial.boxes import EMPTY, area, box_union, load_box, store_box, swept_boxes
from vto_pipeline.numerics.vector import dot, load, sub

_LEAF = 4  # triangles
_SERIAL_BELOW = 500  # queries; a parallel region costs as much as some of them
_FIT_SERIAL_BELOW = 16_000  # triangles, likewise
_SUBTREES = 64  # fitted each by one thread
_WORN = 1.5  # cost over that when built


class Bvh(NamedTuple):
    """Boxes over triangles, as in `boxes`.

    Args:
        order: Triangle at each place of the leaves, shape (F,).
        nodes: Box of each node [m], shape (N, 6), N = 2^(k+1) - 1.
        triangles: Box of each triangle [m], shape (F, 6).
        cost: Of the tree when built, see `degraded`.
    """

    order: NDArray[np.int32]
    nodes: NDArray[np.float64]
    triangles: NDArray[np.float64]
    cost: float


def build(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Bvh:
    """Return the tree over these triangles; vertices [m] shape (V, 3), faces shape (F, 3)."""
    leaves = 1
    while leaves * _LEAF < len(faces):
        leaves *= 2
    order = _halved(_centres(vertices, faces), leaves)
    tree = Bvh(order, np.empty((2 * leaves - 1, 6)), np.empty((len(faces), 6)), 0.0)
    refit(tree, vertices, faces)
    return tree._replace(cost=float(_cost(tree.nodes, tree.triangles)))


@njit(cache=True, error_model="numpy")
def _centres(vertices, faces):
    centres = np.empty((len(faces), 3))
    for f in range(len(faces)):
        for d in range(3):
            centres[f, d] = (vertices[faces[f, 0], d] + vertices[faces[f, 1], d] + vertices[faces[f, 2], d]) / 3.0
    return centres


@njit(cache=True, error_model="numpy")
def _halved(centres, leaves):
    """Return the triangles in the order of the leaves, shape (F,). `centres` of shape (F, 3) end in this order, too."""
    count = len(centres)
    order = np.arange(count).astype(np.int32)
    stack = np.empty((64, 2), np.int64)
    stack[0, 0], stack[0, 1], depth = 0, leaves, 1
    while depth > 0:
        depth -= 1
        left, right = stack[depth, 0], stack[depth, 1]
        if right - left == 1:
            continue
        middle = (left + right) // 2
        first, place, last = left * count // leaves, middle * count // leaves, right * count // leaves
        around = EMPTY
        for k in range(first, last):
            x, y, z = centres[k, 0], centres[k, 1], centres[k, 2]
            around = box_union(around, (x, y, z, x, y, z))
        x, y, z = around[3] - around[0], around[4] - around[1], around[5] - around[2]
        axis = 0 if x >= y and x >= z else (1 if y >= z else 2)
        _select(order, centres, axis, first, last, place)
        stack[depth, 0], stack[depth, 1] = middle, right
        stack[depth + 1, 0], stack[depth + 1, 1] = left, middle
        depth += 2
    return order


@njit(cache=True, error_model="numpy")
def _select(order, centres, axis, first, last, place):
    """Bring the least between first and last along an axis before `place` (Hoare 1961, "Algorithm 65: find").

    Of equal ones, that with the smaller index is less.
    """
    low, high = first, last - 1
    while low < high:
        middle = (low + high) // 2
        x, index = centres[middle, axis], order[middle]
        i, j = low, high
        while i <= j:
            while centres[i, axis] < x or (centres[i, axis] == x and order[i] < index):
                i += 1
            while x < centres[j, axis] or (x == centres[j, axis] and index < order[j]):
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                for d in range(3):
                    centres[i, d], centres[j, d] = centres[j, d], centres[i, d]
                i += 1
                j -= 1
        if place <= j:
            high = j
        elif place >= i:
            low = i
        else:
            return


def refit(tree: Bvh, vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> None:
    """Fit the boxes to moved vertices, in place."""
    refit_swept(tree, vertices, vertices, faces, np.zeros(len(vertices)))


def refit_swept(
    tree: Bvh,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    faces: NDArray[np.int32],
    radius: NDArray[np.float64],
) -> None:
    """Fit the boxes to triangles on their straight path, in place.

    Args:
        tree: Of these faces, shape (F, 3).
        start, end: Of each vertex [m], shape (V, 3).
        faces: Shape (F, 3).
        radius: About each vertex, by which its box is larger on all sides [m], shape (V,).
    """
    boxes = swept_boxes(start, end, radius)
    if len(faces) < _FIT_SERIAL_BELOW:
        _fit_under(tree.order, tree.nodes, tree.triangles, boxes, faces, 0)
    else:
        _fit_parallel(tree.order, tree.nodes, tree.triangles, boxes, faces)


@njit(cache=True, error_model="numpy", parallel=True)
def _fit_parallel(order, nodes, triangles, boxes, faces):
    for root in prange(_SUBTREES - 1, 2 * _SUBTREES - 1):
        _fit_under(order, nodes, triangles, boxes, faces, root)
    for node in range(_SUBTREES - 2, -1, -1):
        store_box(nodes, node, box_union(load_box(nodes, 2 * node + 1), load_box(nodes, 2 * node + 2)))


@njit(cache=True, error_model="numpy")
def _fit_under(order, nodes, triangles, boxes, faces, root):
    """Fit a node and all below it, from the leaves up: each level is a run of nodes."""
    leaves = (len(nodes) + 1) // 2
    first, count = root, 1
    while first < leaves - 1:
        first, count = 2 * first + 1, 2 * count
    for node in range(first, first + count):
        around = EMPTY
        begin, end = leaf_range(len(order), leaves, node)
        for place in range(begin, end):
            t = order[place]
            box = box_union(
                load_box(boxes, faces[t, 0]), box_union(load_box(boxes, faces[t, 1]), load_box(boxes, faces[t, 2]))
            )
            store_box(triangles, t, box)
            around = box_union(around, box)
        store_box(nodes, node, around)
    while first > root:
        first, count = (first - 1) // 2, count // 2
        for node in range(first, first + count):
            store_box(nodes, node, box_union(load_box(nodes, 2 * node + 1), load_box(nodes, 2 * node + 2)))


@njit(cache=True, error_model="numpy", forceinline=True)
def leaf_range(count, leaves, node):
    """Return where the triangles of a leaf begin and end in the order; `count` is of triangles."""
    leaf = node - leaves + 1
    return leaf * count // leaves, (leaf + 1) * count // leaves


def degraded(tree: Bvh, vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> bool:
    """Return whether the triangles have moved so far from their neighbours in the tree that a new one pays.

    A search enters a box in proportion to its area (Goldsmith and Salmon 1987), so the cost of a tree is the area of
    its nodes over that of its triangles. Boxes at rest tell, since those of a long way are all alike.
    """
    still = tree._replace(nodes=np.empty_like(tree.nodes), triangles=np.empty_like(tree.triangles))
    refit(still, vertices, faces)
    return bool(_cost(still.nodes, still.triangles) > _WORN * tree.cost)


@njit(cache=True, error_model="numpy")
def _cost(nodes, triangles):
    inner = whole = 0.0
    for i in range(len(nodes)):
        inner += area(load_box(nodes, i))
    for i in range(len(triangles)):
        whole += area(load_box(triangles, i))
    return inner / whole if whole > 0.0 else 1.0


def closest_triangles(tree, vertices, faces, points, reach, guess=None):
    """Return the nearest triangle to each point, or -1 beyond its reach, with the place on it.

    Args:
        tree: Of these triangles, fitted.
        vertices, faces: The triangles, shapes (V, 3) and (F, 3).
        points: Shape (N, 3).
        reach: How far to look from each point [m], shape (N,).
        guess: A triangle to try first for each point, or -1, shape (N,): the last answer saves most of the search.

    Returns:
        Triangle (N,), barycentric weights (N, 3), feature (N,) as in `distance`.
    """
    if guess is None:
        guess = np.full(len(points), -1, np.int32)
    triangle = np.empty(len(points), np.int32)
    weights = np.empty((len(points), 3))
    feature = np.empty(len(points), np.int8)
    if len(points) < _SERIAL_BELOW:
        _closest_range(tree, vertices, faces, points, reach, guess, 0, len(points), triangle, weights, feature)
    else:
        _closest_parallel(tree, vertices, faces, points, reach, guess, triangle, weights, feature)
    return triangle, weights, feature


@njit(cache=True, parallel=True)
def _closest_parallel(tree, vertices, faces, points, reach, guess, triangle, weights, feature):
    chunks = (len(points) + 63) // 64
    for chunk in prange(chunks):
        first, last = 64 * chunk, min(64 * chunk + 64, len(points))
        _closest_range(tree, vertices, faces, points, reach, guess, first, last, triangle, weights, feature)


@njit(cache=True)
def _closest_range(tree, vertices, faces, points, reach, guess, first, last, triangle, weights, feature):
    stack, away_sq = np.empty(64, np.int64), np.empty(64)
    order, nodes, triangles = tree.order, tree.nodes, tree.triangles
    leaves = (len(nodes) + 1) // 2
    for i in range(first, last):
        p = load(points, i)
        best, best_sq = -1, reach[i] * reach[i]
        best_weights, best_feature = (0.0, 0.0, 0.0), FACE
        if guess[i] >= 0:
            found, on, d_sq = _to_triangle(vertices, faces, guess[i], p)
            if d_sq <= best_sq:
                best, best_sq, best_weights, best_feature = guess[i], d_sq, found, on
        stack[0], away_sq[0], depth = 0, _box_distance_sq(nodes, 0, p), 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if away_sq[depth] > best_sq:
                continue
            if node < leaves - 1:
                near, far = 2 * node + 1, 2 * node + 2
                near_sq, far_sq = _box_distance_sq(nodes, near, p), _box_distance_sq(nodes, far, p)
                if far_sq < near_sq:
                    near, far, near_sq, far_sq = far, near, far_sq, near_sq
                if far_sq <= best_sq:
                    stack[depth], away_sq[depth] = far, far_sq
                    depth += 1
                if near_sq <= best_sq:
                    stack[depth], away_sq[depth] = near, near_sq
                    depth += 1
                continue
            first_place, last_place = leaf_range(len(order), leaves, node)
            for k in range(first_place, last_place):
                if _box_distance_sq(triangles, order[k], p) > best_sq:
                    continue
                found, on, d_sq = _to_triangle(vertices, faces, order[k], p)
                if d_sq < best_sq or (d_sq == best_sq and best < 0):
                    best, best_sq, best_weights, best_feature = order[k], d_sq, found, on
        triangle[i] = best
        feature[i] = best_feature
        weights[i, 0], weights[i, 1], weights[i, 2] = best_weights


@njit(cache=True)
def _to_triangle(vertices, faces, t, p):
    a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
    weights, feature = closest_on_triangle(p, a, b, c)
    away = sub(p, barycentric_point(weights, a, b, c))
    return weights, feature, dot(away, away)


@njit(cache=True)
def _box_distance_sq(nodes, node, p):
    total = 0.0
    for d in range(3):
        out = max(nodes[node, d] - p[d], p[d] - nodes[node, d + 3], 0.0)
        total += out * out
    return total
