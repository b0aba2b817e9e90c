"""The plan of a multifrontal elimination: entries and place of each front.

Liu 1992, "The multifrontal method for sparse matrix solution: theory and practice". Everything here counts blocks of
3 x 3 and depends on the pattern alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.numerics.linear.elimination_tree import supernodes, with_links

BINS = 8  # groups of subtrees that may be factored at the same time, whatever the number of threads
_SPLIT = 16  # subtrees with less than this share of the work are not taken apart


class Elimination(NamedTuple):
    """A plan of elimination of N rows in S supernodes.

    Args:
        order: Row eliminated at each place, shape (N,).
        place: Its inverse, shape (N,).
        first: First place of each supernode, and N, shape (S + 1,).
        row_starts, rows: Places that each supernode touches below itself, ascending.
        within: For each of `rows`, its place in the parent's front (the parent's own places, then its rows).
        child_starts, children: Children of each supernode, ascending.
        panels: Where the factor of each supernode is stored, in scalars, and their number, shape (S + 1,).
        passed_at: Where the matrix is that a supernode passes on, shape (S,).
        room: Scalars needed for those.
        bin_starts, binned: Supernodes of each bin, children first; then those above all bins, shape (BINS + 2,), (S,).
        slots: For each block of the pattern, its place in its column's front; -1 for the half that is not read.
        link_starts, linked: Links first touched by each supernode.
        link_slots: Place of each of a link's vertices in that front, shape (P, 4).
        flops: Of one factorisation.
    """

    order: NDArray[np.int32]
    place: NDArray[np.int32]
    first: NDArray[np.int32]
    row_starts: NDArray[np.int64]
    rows: NDArray[np.int32]
    within: NDArray[np.int32]
    child_starts: NDArray[np.int32]
    children: NDArray[np.int32]
    panels: NDArray[np.int64]
    passed_at: NDArray[np.int64]
    room: int
    bin_starts: NDArray[np.int32]
    binned: NDArray[np.int32]
    slots: NDArray[np.int32]
    link_starts: NDArray[np.int32]
    linked: NDArray[np.int32]
    link_slots: NDArray[np.int32]
    flops: float


def plan_elimination(
    starts: NDArray[np.int32],
    columns: NDArray[np.int32],
    order: NDArray[np.int32],
    vertices: NDArray[np.int32],
    weights: NDArray[np.float64],
) -> Elimination:
    """Return the plan for a pattern and links beside it.

    Args:
        starts, columns: By rows, with the diagonal.
        order: From `dissection`; places may be exchanged where that changes nothing but their neighbourhood.
        vertices, weights: Rows that each link couples, shape (P, 4); those of weight zero take no part.
    """
    begin, near = with_links(starts, columns, vertices, weights)
    order, place, first, row_starts, rows, parents = supernodes(begin, near, order)
    within = _within(first, row_starts, rows, parents)
    child_starts, children = _grouped(parents, len(parents))
    wide, tall = 3.0 * np.diff(first), 3.0 * np.diff(row_starts)
    costs = wide**3 / 3.0 + wide * wide * tall + wide * tall * tall
    bin_starts, binned = _bins(parents, costs)
    passed_at, room = _stacks(9 * np.diff(row_starts) ** 2, parents, bin_starts, binned)
    panels = np.concatenate([[0], np.cumsum((wide * (wide + tall)).astype(np.int64))])
    slots = _slots(starts, columns, order, place, first, row_starts, rows)
    owners, link_slots = _link_slots(vertices, weights, place, first, row_starts, rows)
    link_starts, linked = _grouped(owners, len(parents))
    return Elimination(
        order,
        place,
        first,
        row_starts,
        rows,
        within,
        child_starts,
        children,
        panels,
        passed_at,
        room,
        bin_starts,
        binned,
        slots,
        link_starts,
        linked,
        link_slots,
        float(costs.sum()),
    )


@njit(cache=True)
def _within(first, row_starts, rows, parents):
    within = np.empty(len(rows), np.int32)
    for s in range(len(parents)):
        p = parents[s]
        if p == -1:
            continue
        wide, at = first[p + 1] - first[p], row_starts[p]
        for k in range(row_starts[s], row_starts[s + 1]):
            if rows[k] < first[p + 1]:
                within[k] = rows[k] - first[p]
                continue
            while rows[at] != rows[k]:
                at += 1
            within[k] = wide + at - row_starts[p]
    return within


@njit(cache=True)
def _grouped(owners, count):
    """Return which entries each of `count` owners has, as starts and entries; an owner of -1 is none."""
    starts = np.zeros(count + 1, np.int32)
    for owner in owners:
        if owner >= 0:
            starts[owner + 1] += 1
    for k in range(count):
        starts[k + 1] += starts[k]
    entries, filled = np.empty(starts[count], np.int32), starts[:-1].copy()
    for k in range(len(owners)):
        if owners[k] >= 0:
            entries[filled[owners[k]]] = k
            filled[owners[k]] += 1
    return starts, entries


@njit(cache=True)
def _bins(parents, costs):
    """Return the supernodes of BINS groups of subtrees of like work, then those above them, as starts and entries."""
    count = len(parents)
    whole = costs.copy()
    for s in range(count):
        if parents[s] != -1:
            whole[parents[s]] += whole[s]
    limit = costs.sum() / _SPLIT
    bin_of, load = np.full(count, BINS, np.int32), np.zeros(BINS)
    small = whole <= limit
    roots = np.array([s for s in range(count) if small[s] and (parents[s] == -1 or not small[parents[s]])])
    if len(roots) > 0:
        for k in np.argsort(-whole[roots], kind="mergesort"):
            least = np.argmin(load)
            bin_of[roots[k]] = least
            load[least] += whole[roots[k]]
    for s in range(count - 1, -1, -1):
        if small[s] and parents[s] != -1 and small[parents[s]]:
            bin_of[s] = bin_of[parents[s]]
    return _grouped(bin_of, BINS + 1)


@njit(cache=True)
def _stacks(sizes, parents, bin_starts, binned):
    """Return where supernodes keep what they pass on, and the room for all.

    Each bin has two stacks, for even and for odd depths. What a front takes over is on top of the other one, so that it
    can be made where it stays.
    """
    count = len(parents)
    odd, bin_of = np.zeros(count, np.bool_), np.empty(count, np.int32)
    for s in range(count - 1, -1, -1):  # parents come after their children
        odd[s] = parents[s] != -1 and not odd[parents[s]]
    for b in range(len(bin_starts) - 1):
        bin_of[binned[bin_starts[b] : bin_starts[b + 1]]] = b
    taken = np.zeros(count, np.int64)
    for s in range(count):
        if parents[s] != -1 and bin_of[parents[s]] == bin_of[s]:
            taken[parents[s]] += sizes[s]
    at, base = np.zeros(count, np.int64), 0
    for b in range(len(bin_starts) - 1):
        for parity in (False, True):
            top = peak = base
            for s in binned[bin_starts[b] : bin_starts[b + 1]]:
                if odd[s] == parity:
                    at[s] = top
                    top += sizes[s]
                    peak = max(peak, top)
                else:
                    top -= taken[s]
            base = peak
    return at, base


@njit(cache=True)
def _slot(i, s, first, row_starts, rows):
    """Return where place i is in the front of supernode s."""
    if i < first[s + 1]:
        return i - first[s]
    found = np.searchsorted(rows[row_starts[s] : row_starts[s + 1]], i)
    return first[s + 1] - first[s] + found


@njit(cache=True)
def _slots(starts, columns, order, place, first, row_starts, rows):
    slots = np.full(len(columns), -1, np.int32)
    for s in range(len(first) - 1):
        for j in range(first[s], first[s + 1]):
            for k in range(starts[order[j]], starts[order[j] + 1]):
                i = place[columns[k]]
                if i >= j:
                    slots[k] = _slot(i, s, first, row_starts, rows)
    return slots


@njit(cache=True)
def _link_slots(vertices, weights, place, first, row_starts, rows):
    """Return the supernode that first touches each link, and where in its front each of the link's vertices is."""
    owners, slots = np.full(len(vertices), -1, np.int32), np.zeros(vertices.shape, np.int32)
    for p in range(len(vertices)):
        lowest = len(place)
        for c in range(vertices.shape[1]):
            if weights[p, c] != 0.0:
                lowest = min(lowest, place[vertices[p, c]])
        if lowest == len(place):
            continue
        owners[p] = np.searchsorted(first, lowest, side="right") - 1
        for c in range(vertices.shape[1]):
            if weights[p, c] != 0.0:
                slots[p, c] = _slot(place[vertices[p, c]], owners[p], first, row_starts, rows)
    return owners, slots
