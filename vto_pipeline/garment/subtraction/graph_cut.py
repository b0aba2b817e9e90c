"""Minimum cut of a graph: each vertex has a unary cost, each edge a pairwise cost of being cut.

Minimises sum over x_v = 0 of u_v (for u > 0), over x_v = 1 of -u_v (for u < 0), plus w_ij over cut edges. Greig,
Porteous and Seheult 1989: a minimum cut. Vertices whose unary cost outweighs all their edges are decided beforehand:
this does not change the minimum and leaves the flow a small rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from vto_pipeline.model.arrays import FloatArray, IntArray

RESOLUTION = 10_000
"""Capacities are whole numbers: costs are rounded to this part of one."""


def minimum_cut(unary: FloatArray, edges: IntArray, pairwise: FloatArray) -> NDArray[np.bool_]:
    """Return which vertices fall on the positive side, shape (V,).

    Args:
        unary: Cost of False less that of True: positive towards True, shape (V,); of the order of 1 to 100.
        edges: Shape (E, 2).
        pairwise: Cost of cutting each edge, not negative, shape (E,).
    """
    balance = np.rint(unary * RESOLUTION).astype(np.int64)
    cost = np.rint(pairwise * RESOLUTION).astype(np.int64)
    decided = np.zeros(len(balance), dtype=bool)
    label = np.zeros(len(balance), dtype=bool)
    while True:
        around = np.bincount(edges.reshape(-1), np.repeat(cost, 2), len(balance))
        sure = ~decided & (np.abs(balance) >= around)
        if not sure.any():
            break
        label[sure] = balance[sure] > 0
        decided |= sure
        edges, cost = _absorb_decided(balance, edges, cost, decided, label)
    rest = np.flatnonzero(~decided)
    if len(rest):
        place = np.full(len(balance), -1)
        place[rest] = np.arange(len(rest))
        label[rest] = _solve_minimum_cut(balance[rest], place[edges], cost)
    return label


def _absorb_decided(
    balance: NDArray[np.int64],
    edges: IntArray,
    cost: NDArray[np.int64],
    decided: NDArray[np.bool_],
    label: NDArray[np.bool_],
) -> tuple[IntArray, NDArray[np.int64]]:
    """Turn the edges from decided to open vertices into unary costs of the latter; return the edges among open ones."""
    for near, far in ((0, 1), (1, 0)):
        half = decided[edges[:, near]] & ~decided[edges[:, far]]
        pull = np.where(label[edges[half, near]], cost[half], -cost[half])
        np.add.at(balance, edges[half, far], pull)
    both_open = ~decided[edges].any(axis=1)
    return edges[both_open], cost[both_open]


def _solve_minimum_cut(
    balance: NDArray[np.int64], edges: NDArray[np.int64], cost: NDArray[np.int64]
) -> NDArray[np.bool_]:
    count = len(balance)
    source, sink = count, count + 1
    positive, negative = np.flatnonzero(balance > 0), np.flatnonzero(balance < 0)
    rows = np.concatenate([np.full(len(positive), source), negative, edges[:, 0], edges[:, 1]])
    columns = np.concatenate([positive, np.full(len(negative), sink), edges[:, 1], edges[:, 0]])
    capacity = np.concatenate([balance[positive], -balance[negative], cost, cost]).astype(np.int32)
    network = csr_matrix(coo_matrix((capacity, (rows, columns)), (count + 2, count + 2)))
    flow = maximum_flow(network, source, sink).flow
    left_over = csr_matrix(network - flow)
    left_over.eliminate_zeros()
    reached = np.zeros(count + 2, dtype=bool)
    reached[breadth_first_order(left_over, source, return_predecessors=False)] = True
    return reached[:count]
