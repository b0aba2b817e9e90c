"""A tree of boxes over triangles: built once, refitted when they move, asked for nearest points.

The triangles are put in Morton order and cut into 2^k equal leaves, so the tree is a heap without pointers: the
children of node i are 2i+1 and 2i+2. Karras 2012 gives the ordering; the equal cut trades a little tightness for
brevity.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.distance import FACE, blend, closest_on_triangle
from vto_pipeline.numerics.morton import morton_order
from vto_pipeline.numerics.vector import dot, load, sub

_LEAF = 4  # triangles
_SERIAL_BELOW = 500  # queries; a parallel region costs as much as some of them


class Bvh(NamedTuple):
    """Boxes over triangles.

    Args:
        order: Triangle at each place of the leaves, shape (F,).
        low, high: Corners of each node's box [m], shape (N, 3), N = 2^(k+1) - 1.
    """

    order: NDArray[np.int32]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def build(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> Bvh:
    """Return the tree over these triangles; vertices [m] shape (V, 3), faces shape (F, 3)."""
    order = morton_order(vertices[faces].mean(axis=1))
    leaves = 1
    while leaves * _LEAF < len(faces):
        leaves *= 2
    tree = Bvh(order, np.empty((2 * leaves - 1, 3)), np.empty((2 * leaves - 1, 3)))
    refit(tree, vertices, faces)
    return tree


@njit(cache=True)
def refit(tree, vertices, faces):
    """Fit the boxes to moved vertices, in place."""
    leaves = (len(tree.low) + 1) // 2
    for node in range(len(tree.low) - 1, -1, -1):
        for d in range(3):
            low, high = np.inf, -np.inf
            if node >= leaves - 1:
                leaf = node - leaves + 1
                for i in range(leaf * len(faces) // leaves, (leaf + 1) * len(faces) // leaves):
                    for k in range(3):
                        x = vertices[faces[tree.order[i], k], d]
                        low, high = min(low, x), max(high, x)
            else:
                low = min(tree.low[2 * node + 1, d], tree.low[2 * node + 2, d])
                high = max(tree.high[2 * node + 1, d], tree.high[2 * node + 2, d])
            tree.low[node, d], tree.high[node, d] = low, high


def closest_points(tree, vertices, faces, points, reach, guess=None):
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
    search = _closest_serial if len(points) < _SERIAL_BELOW else _closest_parallel
    triangle = np.empty(len(points), np.int32)
    weights = np.empty((len(points), 3))
    feature = np.empty(len(points), np.int8)
    search(tree, vertices, faces, points, reach, guess, triangle, weights, feature)
    return triangle, weights, feature


@njit(cache=True, parallel=True)
def _closest_parallel(tree, vertices, faces, points, reach, guess, triangle, weights, feature):
    chunks = (len(points) + 63) // 64
    for chunk in prange(chunks):
        first, last = 64 * chunk, min(64 * chunk + 64, len(points))
        _closest_range(tree, vertices, faces, points, reach, guess, first, last, triangle, weights, feature)


@njit(cache=True)
def _closest_serial(tree, vertices, faces, points, reach, guess, triangle, weights, feature):
    _closest_range(tree, vertices, faces, points, reach, guess, 0, len(points), triangle, weights, feature)


@njit(cache=True)
def _closest_range(tree, vertices, faces, points, reach, guess, first, last, triangle, weights, feature):
    stack = np.empty(64, np.int64)
    leaves = (len(tree.low) + 1) // 2
    for i in range(first, last):
        p = load(points, i)
        best, best_sq = -1, reach[i] * reach[i]
        best_weights, best_feature = (0.0, 0.0, 0.0), FACE
        if guess[i] >= 0:
            found, on, d_sq = _to_triangle(vertices, faces, guess[i], p)
            if d_sq <= best_sq:
                best, best_sq, best_weights, best_feature = guess[i], d_sq, found, on
        stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if _box_distance_sq(tree, node, p) > best_sq:
                continue
            if node < leaves - 1:
                near, far = 2 * node + 1, 2 * node + 2
                if _box_distance_sq(tree, far, p) < _box_distance_sq(tree, near, p):
                    near, far = far, near
                stack[depth], stack[depth + 1] = far, near
                depth += 2
                continue
            leaf = node - leaves + 1
            for k in range(leaf * len(faces) // leaves, (leaf + 1) * len(faces) // leaves):
                found, on, d_sq = _to_triangle(vertices, faces, tree.order[k], p)
                if d_sq < best_sq or (d_sq == best_sq and best < 0):
                    best, best_sq, best_weights, best_feature = tree.order[k], d_sq, found, on
        triangle[i] = best
        feature[i] = best_feature
        weights[i, 0], weights[i, 1], weights[i, 2] = best_weights


@njit(cache=True)
def _to_triangle(vertices, faces, t, p):
    a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
    weights, feature = closest_on_triangle(p, a, b, c)
    away = sub(p, blend(weights, a, b, c))
    return weights, feature, dot(away, away)


@njit(cache=True)
def _box_distance_sq(tree, node, p):
    total = 0.0
    for d in range(3):
        out = max(tree.low[node, d] - p[d], p[d] - tree.high[node, d], 0.0)
        total += out * out
    return total
