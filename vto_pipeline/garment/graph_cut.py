"""The exact best division of a graph in two: each vertex has a leaning, each edge a price for being cut.

Minimises sum over x_v = 0 of u_v (for u > 0), over x_v = 1 of -u_v (for u < 0), plus w_ij over cut edges. Greig,
Porteous and Seheult 1989: a minimum cut. Vertices whose leaning outweighs all their edges are settled beforehand, which
does not change the minimum and leaves the flow a small rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from vto_pipeline.model.arrays import FloatArray, IntArray

RESOLUTION = 10_000
"""Capacities are whole numbers: leanings and prices are rounded to this part of one."""


def cut(leaning: FloatArray, edges: IntArray, price: FloatArray) -> NDArray[np.bool_]:
    """Return which vertices fall on the positive side, shape (V,).

    Args:
        leaning: Positive towards True, shape (V,); of the order of 1 to 100.
        edges: Shape (E, 2).
        price: Not negative, shape (E,).
    """
    lean = np.rint(leaning * RESOLUTION).astype(np.int64)
    cost = np.rint(price * RESOLUTION).astype(np.int64)
    settled = np.zeros(len(lean), dtype=bool)
    label = np.zeros(len(lean), dtype=bool)
    while True:
        around = np.bincount(edges.reshape(-1), np.repeat(cost, 2), len(lean))
        sure = ~settled & (np.abs(lean) >= around)
        if not sure.any():
            break
        label[sure] = lean[sure] > 0
        settled |= sure
        edges, cost = _fold_in(lean, edges, cost, settled, label)
    rest = np.flatnonzero(~settled)
    if len(rest):
        place = np.full(len(lean), -1)
        place[rest] = np.arange(len(rest))
        label[rest] = _minimum_cut(lean[rest], place[edges], cost)
    return label


def _fold_in(
    lean: NDArray[np.int64],
    edges: IntArray,
    cost: NDArray[np.int64],
    settled: NDArray[np.bool_],
    label: NDArray[np.bool_],
) -> tuple[IntArray, NDArray[np.int64]]:
    """Turn the edges from settled to open vertices into leanings of the latter; return the edges among open ones."""
    for near, far in ((0, 1), (1, 0)):
        half = settled[edges[:, near]] & ~settled[edges[:, far]]
        pull = np.where(label[edges[half, near]], cost[half], -cost[half])
        np.add.at(lean, edges[half, far], pull)
    both_open = ~settled[edges].any(axis=1)
    return edges[both_open], cost[both_open]


def _minimum_cut(lean: NDArray[np.int64], edges: NDArray[np.int64], cost: NDArray[np.int64]) -> NDArray[np.bool_]:
    count = len(lean)
    source, sink = count, count + 1
    positive, negative = np.flatnonzero(lean > 0), np.flatnonzero(lean < 0)
    rows = np.concatenate([np.full(len(positive), source), negative, edges[:, 0], edges[:, 1]])
    columns = np.concatenate([positive, np.full(len(negative), sink), edges[:, 1], edges[:, 0]])
    capacity = np.concatenate([lean[positive], -lean[negative], cost, cost]).astype(np.int32)
    network = csr_matrix(coo_matrix((capacity, (rows, columns)), (count + 2, count + 2)))
    flow = maximum_flow(network, source, sink).flow
    left_over = csr_matrix(network - flow)
    left_over.eliminate_zeros()
    reached = np.zeros(count + 2, dtype=bool)
    reached[breadth_first_order(left_over, source, return_predecessors=False)] = True
    return reached[:count]
