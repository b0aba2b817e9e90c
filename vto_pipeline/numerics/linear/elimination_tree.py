"""Elimination order of a sparse symmetric matrix, and the fill of its factor.

The order comes from nested dissection (George 1973; METIS, Karypis & Kumar 1998). Columns of the factor with the same
rows below them are eliminated together, as supernodes; they form a tree, children before parents (Liu 1990, "The role
of elimination trees in sparse factorization"). Everything depends on the pattern alone.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

_RELAXED = ((2, 1.0), (6, 0.5), (16, 0.15), (1 << 30, 0.05))
"""(columns of a supernode, share of zeros it may store to be that wide)."""


def dissection(starts: NDArray[np.int32], columns: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return an order of elimination with little fill, shape (N,), for a pattern with its diagonal.

    Args:
        starts, columns: By rows; symmetric, repeats allowed.
    """
    import pymetis

    count = len(starts) - 1
    if count < 2:
        return np.arange(count, dtype=np.int32)
    neighbours = _without_diagonal(starts, columns)
    order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(*neighbours))
    return np.asarray(order, np.int32)


@njit(cache=True)
def _without_diagonal(starts, columns):
    """Return the pattern by rows, each other column once."""
    count = len(starts) - 1
    begin, kept, seen, filled = np.zeros(count + 1, np.int32), np.empty(len(columns), np.int32), np.full(count, -1), 0
    for i in range(count):
        seen[i] = i
        for k in range(starts[i], starts[i + 1]):
            if seen[columns[k]] != i:
                seen[columns[k]] = i
                kept[filled] = columns[k]
                filled += 1
        begin[i + 1] = filled
    return begin, kept[:filled].copy()


@njit(cache=True)
def with_links(starts, columns, vertices, weights):
    """Return the pattern by rows with what links couple added; repeats are left in."""
    count = len(starts) - 1
    begin = np.zeros(count + 1, np.int32)
    for p in range(len(vertices)):
        used = (weights[p] != 0.0).sum()
        for s in range(vertices.shape[1]):
            if weights[p, s] != 0.0:
                begin[vertices[p, s] + 1] += used
    for i in range(count):
        begin[i + 1] += begin[i] + starts[i + 1] - starts[i]
    near = np.empty(begin[count], np.int32)
    filled = begin[:count].copy()
    for i in range(count):
        for k in range(starts[i], starts[i + 1]):
            near[filled[i]] = columns[k]
            filled[i] += 1
    for p in range(len(vertices)):
        for s in range(vertices.shape[1]):
            for t in range(vertices.shape[1]):
                if weights[p, s] != 0.0 and weights[p, t] != 0.0:
                    i = vertices[p, s]
                    near[filled[i]] = vertices[p, t]
                    filled[i] += 1
    return begin, near


def supernodes(starts, columns, order):  # type: ignore[no-untyped-def]
    """Return the supernodes of an order.

    Args:
        starts, columns: The pattern by rows, repeats allowed.
        order: From `dissection`.

    Returns:
        Row eliminated at each place and its inverse (N,), children before parents; first place of each supernode and N
        (S + 1,); places that each touches below itself, ascending, by supernodes (S + 1,), (R,); parents, -1 for roots.
    """
    return _supernodes(starts, columns, order, np.array(_RELAXED))


@njit(cache=True)
def _supernodes(starts, columns, order, relaxed):
    """Return order and place with children before parents, the supernodes' columns and rows, and their parents."""
    count = len(order)
    place = np.empty(count, np.int32)
    for j in range(count):
        place[order[j]] = j
    order = order[_postorder(_tree(starts, columns, order, place))]
    for j in range(count):
        place[order[j]] = j
    parent = _tree(starts, columns, order, place)
    begin, below = _structure(starts, columns, order, place, parent)
    first, merged = _merged(begin, parent, relaxed)
    total = 0
    for s in range(merged):
        last = first[s + 1] - 1
        total += begin[last + 1] - begin[last]
    row_starts, rows, parents = np.zeros(merged + 1, np.int64), np.empty(total, np.int32), np.empty(merged, np.int32)
    owner = np.empty(count, np.int32)
    for s in range(merged):
        owner[first[s] : first[s + 1]] = s
    for s in range(merged):
        last = first[s + 1] - 1
        found = np.sort(below[begin[last] : begin[last + 1]])
        rows[row_starts[s] : row_starts[s] + len(found)] = found
        row_starts[s + 1] = row_starts[s] + len(found)
        parents[s] = owner[found[0]] if len(found) > 0 else -1
    return order, place, first, row_starts, rows, parents


@njit(cache=True)
def _tree(starts, columns, order, place):
    """Return the parent of each place in the elimination tree, -1 for roots (Liu 1990, algorithm 4.2)."""
    count = len(order)
    parent, above = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    for i in range(count):
        for k in range(starts[order[i]], starts[order[i] + 1]):
            j = place[columns[k]]
            while j < i and j != -1:
                higher = above[j]
                above[j] = i
                if higher == -1:
                    parent[j] = i
                j = higher
                if j == i:
                    break
    return parent


@njit(cache=True)
def _postorder(parent):
    """Return the places such that each subtree is contiguous and ends with its root."""
    count = len(parent)
    child, sibling = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    for j in range(count - 1, -1, -1):
        if parent[j] != -1:
            sibling[j] = child[parent[j]]
            child[parent[j]] = j
    post, stack, filled = np.empty(count, np.int32), np.empty(count, np.int32), 0
    for root in range(count):
        if parent[root] != -1:
            continue
        stack[0], deep = root, 1
        while deep > 0:
            j = stack[deep - 1]
            if child[j] != -1:
                stack[deep] = child[j]
                deep += 1
                child[j] = sibling[child[j]]
            else:
                post[filled] = j
                filled += 1
                deep -= 1
    return post


@njit(cache=True)
def _structure(starts, columns, order, place, parent):
    """Return the rows under the diagonal of each column of the factor, as starts and places, unsorted."""
    count = len(order)
    begin, seen = np.zeros(count + 1, np.int64), np.full(count, -1, np.int32)
    child, sibling = np.full(count, -1, np.int32), np.full(count, -1, np.int32)
    below, filled = np.empty(8 * len(columns) + count, np.int32), 0
    for j in range(count):
        if filled + count > len(below):
            wider = np.empty(2 * len(below) + count, np.int32)
            wider[:filled] = below[:filled]
            below = wider
        seen[j] = j
        for k in range(starts[order[j]], starts[order[j] + 1]):
            i = place[columns[k]]
            if i > j and seen[i] != j:
                seen[i] = j
                below[filled] = i
                filled += 1
        c = child[j]
        while c != -1:
            for k in range(begin[c], begin[c + 1]):
                i = below[k]
                if seen[i] != j:
                    seen[i] = j
                    below[filled] = i
                    filled += 1
            c = sibling[c]
        begin[j + 1] = filled
        if parent[j] != -1:
            sibling[j] = child[parent[j]]
            child[parent[j]] = j
    return begin, below[:filled].copy()


@njit(cache=True)
def _merged(begin, parent, relaxed):
    """Return the first place of each supernode, and how many there are.

    A place joins the supernode before it where that one's rows are just this place and its rows; a supernode joins its
    parent next to it where few zeros come to be stored by that (Ashcraft & Grimes 1989).
    """
    count = len(parent)
    first = np.empty(count + 1, np.int32)
    zeros = np.zeros(count + 1)
    made = 0
    for j in range(count):
        first[made], zeros[made] = j, 0.0
        made += 1
        while made > 1:
            before, now = first[made - 2], first[made - 1]
            if parent[now - 1] == -1 or parent[now - 1] > j or parent[now - 1] < now:
                break
            wide, added = now - before, j + 1 - now
            tall = begin[j + 1] - begin[j]
            stored = zeros[made - 2] + zeros[made - 1]
            stored += wide * (added + tall - (begin[now] - begin[now - 1]))
            total = wide + added
            if stored > 0.0:
                share = stored / (0.5 * total * total + total * tall)
                k = 0
                while relaxed[k, 0] < total:
                    k += 1
                if share > relaxed[k, 1]:
                    break
            made -= 1
            zeros[made - 1] = stored
    first[made] = count
    return first[: made + 1].copy(), made
