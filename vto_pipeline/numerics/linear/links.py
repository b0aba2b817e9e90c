"""Low-rank couplings beside the pattern of a matrix: Gᵀ B G, with a few weights G per link and 3 x 3 blocks B.

A contact couples vertices that no edge joins, and others in every step, so its terms have no place among a mesh's
blocks. They are applied as they are: G gathers, B weighs, Gᵀ gives back. On a coarse level of a multigrid with
interpolation P the weights are G P, which is Galerkin's product without its cost.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.linear.block_matrix import CHUNK, PARALLEL_FROM, Sparse


class Links(NamedTuple):
    """P links on each of L levels.

    Args:
        starts, columns, weights: G of all levels by rows (see `block_matrix.Sparse`): row `level * P + link`; columns
            are rows of the stacked levels. Flat, since Numba's parallel loops take no tuple within a tuple.
        back_starts, back_columns, back_weights: Its transpose.
        spread: Sum of the absolute weights of each row of G.
        blocks: B, shape (P, 3, 3).
        pulls: Working room: B G x, shape (P, 3).
    """

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    weights: NDArray[np.float64]
    back_starts: NDArray[np.int32]
    back_columns: NDArray[np.int32]
    back_weights: NDArray[np.float64]
    spread: NDArray[np.float64]
    blocks: NDArray[np.float64]
    pulls: NDArray[np.float64]


def no_links(rows: int) -> Links:
    """Return no links for this many rows of all levels together."""
    none, weights = np.empty(0, np.int32), np.empty(0)
    return Links(
        np.zeros(1, np.int32),
        none,
        weights,
        np.zeros(rows + 1, np.int32),
        none,
        weights,
        np.empty(0),
        np.empty((0, 3, 3)),
        np.empty((0, 3)),
    )


def make_links(vertices: NDArray[np.int32], weights: NDArray[np.float64], up: Sparse, rows: NDArray[np.int64]) -> Links:
    """Return links on all levels, with blocks of zero.

    Args:
        vertices: Rows of the first level that each link couples, shape (P, S).
        weights: Of each, shape (P, S); zero for what takes no part.
        up: Interpolation: the weights of each row on the rows of the next level.
        rows: First row of each level, and their number, shape (L + 1,).
    """
    count = len(vertices)
    if count == 0:
        return no_links(int(rows[-1]))
    starts, columns, kept = _restrict_to_levels(vertices, weights, up, len(rows) - 1)
    owner = np.repeat(np.arange(len(starts) - 1, dtype=np.int32), np.diff(starts))
    order = np.argsort(columns, kind="stable")
    begin = np.searchsorted(columns[order], np.arange(rows[-1] + 1)).astype(np.int32)
    spread = np.bincount(owner, np.abs(kept), minlength=len(starts) - 1).astype(np.float64)
    return Links(
        starts,
        columns,
        kept,
        begin,
        owner[order],
        kept[order],
        spread,
        np.zeros((count, 3, 3)),
        np.zeros((count, 3)),
    )


@njit(cache=True, error_model="numpy")
def _restrict_to_levels(vertices, weights, up, levels):
    """Return G of the first level and G P of each following one, as starts, columns and weights."""
    count, corners = vertices.shape
    starts = np.zeros(count * levels + 1, np.int32)
    columns, kept = np.empty(8 * count * levels + 8, np.int32), np.empty(8 * count * levels + 8)
    filled = 0
    for p in range(count):
        for s in range(corners):
            if weights[p, s] != 0.0:
                columns[filled], kept[filled] = vertices[p, s], weights[p, s]
                filled += 1
        starts[p + 1] = filled
    for row in range(count, count * levels):
        first = filled
        for k in range(starts[row - count], starts[row - count + 1]):
            fine, weight = columns[k], kept[k]
            for m in range(up.starts[fine], up.starts[fine + 1]):
                place = first
                while place < filled and columns[place] != up.columns[m]:
                    place += 1
                if place == filled:
                    if filled == len(columns):
                        columns, kept = _doubled(columns), _doubled(kept)
                    columns[filled], kept[filled] = up.columns[m], 0.0
                    filled += 1
                kept[place] += weight * up.weights[m]
        starts[row + 1] = filled
    return starts, columns[:filled].copy(), kept[:filled].copy()


@njit(cache=True)
def _doubled(array):
    wider = np.empty(2 * len(array), array.dtype)
    wider[: len(array)] = array
    return wider


@njit(cache=True, error_model="numpy")
def apply_links(links, level, x):
    """Set links.pulls to B G x on a level; x of shape (rows, 3) is the level's part of the stacked rows."""
    count = len(links.blocks)
    if count >= PARALLEL_FROM:
        _pull_parallel(links, level, x)
    elif count > 0:
        _pull_some(links, level, x, np.int64(0), count)


@njit(cache=True, error_model="numpy", parallel=True)
def _pull_parallel(links, level, x):
    count = len(links.blocks)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _pull_some(links, level, x, CHUNK * chunk, min(count, CHUNK * chunk + CHUNK))


@njit(cache=True, error_model="numpy")
def _pull_some(links, level, x, first, end):
    starts, columns, weights = links.starts, links.columns, links.weights
    for p in range(first, end):
        row = level * len(links.blocks) + p
        a = b = c = 0.0
        for k in range(starts[row], starts[row + 1]):
            j, w = columns[k], weights[k]
            a += w * x[j, 0]
            b += w * x[j, 1]
            c += w * x[j, 2]
        for k in range(3):
            links.pulls[p, k] = links.blocks[p, k, 0] * a + links.blocks[p, k, 1] * b + links.blocks[p, k, 2] * c


@njit(cache=True, error_model="numpy")
def apply_links_transposed(links, i):
    """Return row i of Gᵀ links.pulls."""
    a = b = c = 0.0
    count = len(links.blocks)
    for k in range(links.back_starts[i], links.back_starts[i + 1]):
        p, w = links.back_columns[k] % count, links.back_weights[k]
        a += w * links.pulls[p, 0]
        b += w * links.pulls[p, 1]
        c += w * links.pulls[p, 2]
    return a, b, c


@njit(cache=True, error_model="numpy")
def spread_block(links, i, block):
    """Add to a diagonal block what makes it, with those of all rows, an upper bound of Gᵀ B G.

    The sum of |weight| over a link times this row's |weight| (the l1 norm of its row, Baker et al. 2011, "Multigrid
    smoothers for ultraparallel computing"): with the bare diagonal, Jacobi's iteration diverges on links of four.
    """
    count = len(links.blocks)
    for k in range(links.back_starts[i], links.back_starts[i + 1]):
        row = links.back_columns[k]
        bound = abs(links.back_weights[k]) * links.spread[row]
        for a in range(3):
            for b in range(3):
                block[a, b] += bound * links.blocks[row % count, a, b]


@njit(cache=True, error_model="numpy")
def add_to_dense(links, level, first, matrix):
    """Add Gᵀ B G of a level to its dense matrix, the level's rows counted from `first`."""
    starts, columns, weights = links.starts, links.columns, links.weights
    count = len(links.blocks)
    for p in range(count):
        row = level * count + p
        for k in range(starts[row], starts[row + 1]):
            for m in range(starts[row], starts[row + 1]):
                i, j, w = 3 * (columns[k] - first), 3 * (columns[m] - first), weights[k] * weights[m]
                for a in range(3):
                    for b in range(3):
                        matrix[i + a, j + b] += w * links.blocks[p, a, b]
