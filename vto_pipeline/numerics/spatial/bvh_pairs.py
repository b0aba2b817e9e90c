"""Pairs of triangles with overlapping boxes, within one tree or between two."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.spatial.boxes import boxes_overlap, load_box
from vto_pipeline.numerics.spatial.bvh import Bvh, leaf_range
from vto_pipeline.numerics.spatial.pair_lists import collect

_CHUNK = 16  # leaves a thread takes at a time
_ROOM = 64  # pairs a leaf is expected to find at most
_SERIAL_BELOW = 512  # leaves; starting the threads costs as much as they save


def self_pairs(tree: Bvh) -> NDArray[np.int32]:
    """Return the pairs of triangles whose closed boxes overlap, each once, in no order that means anything: (N, 2)."""
    return _pairs(tree, tree, True)


def cross_pairs(tree: Bvh, other: Bvh) -> NDArray[np.int32]:
    """Return the pairs (triangle of the one, of the other) whose closed boxes overlap, shape (N, 2)."""
    return _pairs(tree, other, False)


def _pairs(tree: Bvh, other: Bvh, same: bool) -> NDArray[np.int32]:
    leaves = (len(tree.nodes) + 1) // 2
    search = _search_serial if leaves < _SERIAL_BELOW else _search_parallel
    return collect(
        lambda starts, found, counts: search(tree, other, same, starts, found, counts),
        (leaves + _CHUNK - 1) // _CHUNK,
        _CHUNK * _ROOM,
    )


@njit(cache=True, error_model="numpy", parallel=True)
def _search_parallel(tree, other, same, starts, found, counts):
    for chunk in prange(len(counts)):
        counts[chunk] = _search_chunk(tree, other, same, np.int64(chunk), starts, found)


@njit(cache=True, error_model="numpy")
def _search_serial(tree, other, same, starts, found, counts):
    for chunk in range(len(counts)):
        counts[chunk] = _search_chunk(tree, other, same, chunk, starts, found)


@njit(cache=True, error_model="numpy")
def _search_chunk(tree, other, same, chunk, starts, found):
    """Write the pairs of some leaves to their place, as far as there is room, and return how many there are."""
    leaves = (len(tree.nodes) + 1) // 2
    first, last = _CHUNK * chunk, min(_CHUNK * (chunk + 1), leaves)
    room = found[starts[chunk] : starts[chunk + 1]]
    return _search(
        tree.order, tree.nodes, tree.triangles, other.order, other.nodes, other.triangles, same, first, last, room
    )


@njit(cache=True, error_model="numpy")
def _search(order, nodes, triangles, other_order, other_nodes, other_triangles, same, first, last, found):
    leaves, other_leaves = (len(nodes) + 1) // 2, (len(other_nodes) + 1) // 2
    stack = np.empty(128, np.int64)
    count = 0
    for node in range(leaves - 1 + first, leaves - 1 + last):
        begin, end = leaf_range(len(order), leaves, node)
        box = load_box(nodes, node)
        if same:
            for i in range(begin, end):
                count = _test_against(order[i], triangles, order, triangles, i + 1, end, found, count)
            depth, up = 0, node
            while up > 0:  # every later leaf is under the right sibling of this one or of one of its ancestors
                if up % 2 == 1:
                    stack[depth] = up + 1
                    depth += 1
                up = (up - 1) // 2
        else:
            stack[0], depth = 0, 1
        while depth > 0:
            depth -= 1
            visit = stack[depth]
            if not boxes_overlap(box, other_nodes, visit):
                continue
            if visit < other_leaves - 1:
                stack[depth], stack[depth + 1] = 2 * visit + 2, 2 * visit + 1
                depth += 2
                continue
            other_begin, other_end = leaf_range(len(other_order), other_leaves, visit)
            for i in range(begin, end):
                if boxes_overlap(load_box(triangles, order[i]), other_nodes, visit):
                    count = _test_against(
                        order[i], triangles, other_order, other_triangles, other_begin, other_end, found, count
                    )
    return count


@njit(cache=True, error_model="numpy", forceinline=True)
def _test_against(triangle, boxes, other_order, other_boxes, begin, end, found, count):
    """Write a triangle's pairs with those at some places of the order; return how many there are now."""
    box = load_box(boxes, triangle)
    for place in range(begin, end):
        other = other_order[place]
        if count < len(found):
            found[count, 0], found[count, 1] = triangle, other  # kept or overwritten: a branch would be a coin toss
        count += boxes_overlap(box, other_boxes, other)
    return count
