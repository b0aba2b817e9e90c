"""Smoothed-aggregation multigrid for the stiffness of a sheet, as a global preconditioner.

Vaněk, Mandel & Brezina 1996; for cloth Tamstorf, Jones & McCormick 2015. The interpolation comes from the graph of the
mesh alone (each direction of space by itself), so it is made once for a mesh; only the coarse matrices Pᵀ A P follow
the cloth. All levels live in one matrix, one after the other, the finest first. Links (`numerics.links`) add what a
contact couples across the mesh to every level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.linear.block_matrix import CHUNK, PARALLEL_FROM, BlockMatrix, Sparse, row_times
from vto_pipeline.numerics.linear.links import (
    Links,
    add_to_dense,
    apply_links,
    apply_links_transposed,
    no_links,
    spread_block,
)

_COARSEST = 24  # rows solved directly
_DAMPING = 0.6  # of block Jacobi; stable while the largest eigenvalue of D⁻¹A, some 2, stays under 3.3


class Hierarchy(NamedTuple):
    """All levels.

    Args:
        rows: First row of each level, and their number, shape (L + 1,).
        slots: First block of each level, and their number, shape (L + 1,).
        matrix: The matrices of all levels along the diagonal of one; the first level's blocks are to be written.
        inverse: Of the diagonal blocks, shape (rows, 3, 3).
        coarsest: Inverse of the last level's matrix, dense.
        up: Interpolation: a row's weights on the rows of the next level.
        down: Its transpose.
        galerkin: For each coarse block, the finer blocks that it sums, with weights.
        links: What is coupled beside the pattern; none unless replaced.
        right, guess, rest: Working vectors, shape (rows, 3).
    """

    rows: NDArray[np.int64]
    slots: NDArray[np.int64]
    matrix: BlockMatrix
    inverse: NDArray[np.float64]
    coarsest: NDArray[np.float64]
    up: Sparse
    down: Sparse
    galerkin: Sparse
    links: Links
    right: NDArray[np.float64]
    guess: NDArray[np.float64]
    rest: NDArray[np.float64]


def hierarchy(fine: BlockMatrix, held: NDArray[np.bool_]) -> Hierarchy:
    """Return the levels over a matrix of this pattern.

    Args:
        fine: Its blocks are not read; write those of the first level of the result.
        held: Rows that are an identity, and take no part, shape (N,).
    """
    from scipy import sparse

    count = len(held)
    ups = _interpolations(fine, held) if count > _COARSEST else []
    sizes = [count] + [up.shape[1] for up in ups]
    rows = np.concatenate([[0], np.cumsum(sizes)])
    matrices, sums = [fine], []
    for up in ups:
        coarse, terms = _galerkin(matrices[-1], up)
        matrices.append(coarse)
        sums.append(terms)
    slots = np.concatenate([[0], np.cumsum([len(one.columns) for one in matrices])])
    total = int(rows[-1])
    return Hierarchy(
        rows,
        slots,
        _stack(matrices, rows, slots),
        np.zeros((total, 3, 3)),
        np.zeros((3 * sizes[-1], 3 * sizes[-1])),
        _stack_sparse([sparse.csr_array(up) for up in ups], rows[1:], sizes[-1]),
        _stack_sparse([sparse.csr_array(up.T) for up in ups], rows[:-1], 0),
        _stack_sums(sums, slots),
        no_links(total),
        np.zeros((total, 3)),
        np.zeros((total, 3)),
        np.zeros((total, 3)),
    )


def _interpolations(fine: BlockMatrix, held: NDArray[np.bool_]):  # type: ignore[no-untyped-def]
    """Return the interpolation from each level to the finer one, finest first; held rows have none."""
    from pyamg.aggregation import smoothed_aggregation_solver
    from scipy import sparse

    count = len(held)
    graph = sparse.csr_array((-np.ones(len(fine.columns)), fine.columns, fine.starts), shape=(count, count))
    graph.setdiag(0.0)
    graph.setdiag(-graph.sum(axis=1))
    found = smoothed_aggregation_solver(
        sparse.csr_matrix(graph),
        strength=None,
        smooth=("jacobi", {"weighting": "local"}),  # by rows: the usual estimate of an eigenvalue is a random one
        max_coarse=_COARSEST,
        max_levels=20,
        keep=False,
    )
    ups = [sparse.csr_array(level.P) for level in found.levels[:-1]]
    if ups:
        ups[0] = sparse.csr_array(sparse.diags_array((~held).astype(float)) @ ups[0])
        ups[0].eliminate_zeros()
    return ups


def _galerkin(fine: BlockMatrix, up):  # type: ignore[no-untyped-def]
    """Return the pattern of Pᵀ A P, and for each of its blocks the fine blocks with their weights."""
    from scipy import sparse

    slot = sparse.coo_array(
        sparse.csr_array((np.arange(1, len(fine.columns) + 1), fine.columns, fine.starts), shape=(up.shape[0],) * 2)
    )
    width = np.diff(up.indptr)
    # every pair (weight of the row, weight of the column) of every fine block
    pairs = width[slot.row] * width[slot.col]
    source = np.repeat(np.arange(len(pairs)), pairs)
    within = np.arange(len(source)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    across = width[slot.col][source]
    left = up.indptr[slot.row][source] + within // across
    right = up.indptr[slot.col][source] + within % across
    count = up.shape[1]
    keys = up.indices[left].astype(np.int64) * count + up.indices[right]
    own = np.arange(count, dtype=np.int64) * (count + 1)
    kept, place = np.unique(np.concatenate([keys, own]), return_inverse=True)
    starts = np.searchsorted(kept, np.arange(count + 1, dtype=np.int64) * count)
    coarse = BlockMatrix(
        starts.astype(np.int32),
        (kept % count).astype(np.int32),
        np.empty((0, 3, 3)),
        place[len(keys) :].astype(np.int32),
    )
    place = place[: len(keys)]
    order = np.argsort(place, kind="stable")
    terms = (
        np.searchsorted(place[order], np.arange(len(kept) + 1)),
        slot.data[source[order]] - 1,
        up.data[left[order]] * up.data[right[order]],
    )
    return coarse, terms


def _stack(matrices, rows, slots) -> BlockMatrix:  # type: ignore[no-untyped-def]
    starts = [one.starts[:-1] + first for one, first in zip(matrices, slots, strict=False)]
    return BlockMatrix(
        np.concatenate([*starts, slots[-1:]]).astype(np.int32),
        np.concatenate([one.columns + first for one, first in zip(matrices, rows, strict=False)]).astype(np.int32),
        np.zeros((int(slots[-1]), 3, 3)),
        np.concatenate([one.diagonal + first for one, first in zip(matrices, slots, strict=False)]).astype(np.int32),
    )


def _stack_sparse(parts, columns, empty) -> Sparse:  # type: ignore[no-untyped-def]
    """Return rows of all parts one after the other, their columns shifted, and some empty rows at the end."""
    starts, first = [np.zeros(1, np.int64)], 0
    for part in parts:
        starts.append(part.indptr[1:] + first)
        first += len(part.indices)
    starts.append(np.full(empty, first))
    return Sparse(
        np.concatenate(starts).astype(np.int32),
        np.concatenate([np.empty(0), *(p.indices + c for p, c in zip(parts, columns, strict=False))]).astype(np.int32),
        np.concatenate([np.empty(0), *(part.data for part in parts)]),
    )


def _stack_sums(sums, slots) -> Sparse:  # type: ignore[no-untyped-def]
    starts, first = [np.zeros(1, np.int64)], 0
    for begin, _, _ in sums:
        starts.append(begin[1:] + first)
        first += int(begin[-1])
    return Sparse(
        np.concatenate(starts).astype(np.int64),
        np.concatenate([np.empty(0), *(s + c for (_, s, _), c in zip(sums, slots, strict=False))]).astype(np.int32),
        np.concatenate([np.empty(0), *(weight for _, _, weight in sums)]),
    )


@njit(cache=True, error_model="numpy")
def update_hierarchy(levels):
    """Make the coarse matrices and the inverses after the first level's blocks have been written."""
    matrix = levels.matrix
    last = len(levels.rows) - 2
    for level in range(1, last + 1):
        first, end = levels.slots[level], levels.slots[level + 1]
        if end - first >= PARALLEL_FROM:
            _sum_parallel(matrix, levels.galerkin, levels.slots[1], first, end)
        else:
            _sum_blocks(matrix, levels.galerkin, levels.slots[1], first, end)
        for row in range(levels.rows[level], levels.rows[level + 1]):
            block = matrix.blocks[matrix.diagonal[row]]
            if block[0, 0] == 0.0:  # all that it stands for is held
                block[0, 0] = block[1, 1] = block[2, 2] = 1.0
    if levels.rows[last + 1] >= PARALLEL_FROM:
        _invert_parallel(matrix, levels.links, levels.inverse)
    else:
        _invert_rows(matrix, levels.links, levels.inverse, 0, levels.rows[last + 1])
    first = levels.rows[last]
    levels.coarsest[:] = 0.0
    for row in range(first, levels.rows[last + 1]):
        for k in range(matrix.starts[row], matrix.starts[row + 1]):
            i, j = 3 * (row - first), 3 * (matrix.columns[k] - first)
            levels.coarsest[i : i + 3, j : j + 3] = matrix.blocks[k]
    add_to_dense(levels.links, last, first, levels.coarsest)
    invert_dense(levels.coarsest)


@njit(cache=True, error_model="numpy", parallel=True)
def _sum_parallel(matrix, terms, fine, first, end):
    for chunk in prange((end - first + CHUNK - 1) // CHUNK):
        _sum_blocks(matrix, terms, fine, first + CHUNK * chunk, min(end, first + CHUNK * chunk + CHUNK))


@njit(cache=True, error_model="numpy")
def _sum_blocks(matrix, terms, fine, first, end):
    blocks = matrix.blocks
    for slot in range(first, end):
        a = b = c = d = e = f = g = h = i = 0.0
        for k in range(terms.starts[slot - fine], terms.starts[slot - fine + 1]):
            w, s = terms.weights[k], terms.columns[k]
            a += w * blocks[s, 0, 0]
            b += w * blocks[s, 0, 1]
            c += w * blocks[s, 0, 2]
            d += w * blocks[s, 1, 0]
            e += w * blocks[s, 1, 1]
            f += w * blocks[s, 1, 2]
            g += w * blocks[s, 2, 0]
            h += w * blocks[s, 2, 1]
            i += w * blocks[s, 2, 2]
        blocks[slot, 0, 0], blocks[slot, 0, 1], blocks[slot, 0, 2] = a, b, c
        blocks[slot, 1, 0], blocks[slot, 1, 1], blocks[slot, 1, 2] = d, e, f
        blocks[slot, 2, 0], blocks[slot, 2, 1], blocks[slot, 2, 2] = g, h, i


@njit(cache=True, error_model="numpy", parallel=True)
def _invert_parallel(matrix, links, inverse):
    total = len(inverse)
    for chunk in prange((total + CHUNK - 1) // CHUNK):
        _invert_rows(matrix, links, inverse, CHUNK * chunk, min(total, CHUNK * chunk + CHUNK))


@njit(cache=True, error_model="numpy")
def _invert_rows(matrix, links, inverse, first, end):
    block = np.empty((3, 3))
    for i in range(first, end):
        block[:] = matrix.blocks[matrix.diagonal[i]]
        spread_block(links, i, block)
        invert(block, inverse[i])


@njit(cache=True, error_model="numpy")
def invert(d, out):
    """Write the inverse of a symmetric 3 x 3 matrix into out."""
    c00 = d[1, 1] * d[2, 2] - d[1, 2] * d[2, 1]
    c01 = d[0, 2] * d[2, 1] - d[0, 1] * d[2, 2]
    c02 = d[0, 1] * d[1, 2] - d[0, 2] * d[1, 1]
    det = d[0, 0] * c00 + d[1, 0] * c01 + d[2, 0] * c02
    out[0, 0], out[0, 1], out[0, 2] = c00 / det, c01 / det, c02 / det
    out[1, 0], out[2, 0] = out[0, 1], out[0, 2]
    out[1, 1] = (d[0, 0] * d[2, 2] - d[0, 2] * d[2, 0]) / det
    out[1, 2] = (d[0, 2] * d[1, 0] - d[0, 0] * d[1, 2]) / det
    out[2, 1] = out[1, 2]
    out[2, 2] = (d[0, 0] * d[1, 1] - d[0, 1] * d[1, 0]) / det


@njit(cache=True, error_model="numpy")
def invert_dense(matrix):
    """Invert a symmetric positive definite matrix in place, by Gauss and Jordan; it needs no pivots.

    LAPACK would bring its own threads, which for a matrix this small wait longer than they work.
    """
    size = len(matrix)
    for k in range(size):
        pivot = 1.0 / matrix[k, k]
        matrix[k, k] = 1.0
        for j in range(size):
            matrix[k, j] *= pivot
        for i in range(size):
            if i == k:
                continue
            factor = matrix[i, k]
            matrix[i, k] = 0.0
            for j in range(size):
                matrix[i, j] -= factor * matrix[k, j]


@njit(cache=True, error_model="numpy")
def v_cycle(levels):
    """Take one V-cycle for A guess = right on the first level: `right` is read, `guess` written.

    One sweep of damped block Jacobi before and after, so the cycle is symmetric and may precondition CG.
    """
    last = len(levels.rows) - 2
    for level in range(last):
        _each(_DOWN_SMOOTH, levels, level)
        _each(_DOWN_RESIDUAL, levels, level)
        _each(_DOWN_RESTRICT, levels, level)
    _solve_coarsest(levels, levels.rows[last], levels.rows[last + 1])
    for level in range(last - 1, -1, -1):
        _each(_UP_ADD, levels, level)
        _each(_UP_RESIDUAL, levels, level)


_DOWN_SMOOTH, _DOWN_RESIDUAL, _DOWN_RESTRICT, _UP_ADD, _UP_RESIDUAL = range(5)


@njit(cache=True, error_model="numpy")
def _each(what, levels, level):
    of = level + 1 if what == _DOWN_RESTRICT else level
    first, end = levels.rows[of], levels.rows[of + 1]
    links = levels.links
    if what in (_DOWN_RESIDUAL, _UP_RESIDUAL):
        apply_links(links, level, levels.guess)
    matrix, inverse, up, down = levels.matrix, levels.inverse, levels.up, levels.down
    right, guess, rest = levels.right, levels.guess, levels.rest
    if end - first >= PARALLEL_FROM:
        _each_parallel(what, matrix, links, inverse, up, down, right, guess, rest, levels.rows[1], first, end)
    else:
        _each_row(what, matrix, links, inverse, up, down, right, guess, rest, levels.rows[1], first, end)
    if what == _UP_RESIDUAL:  # Jacobi: the guess changes after all residuals are known
        for i in range(first, end):
            for k in range(3):
                levels.guess[i, k] += levels.rest[i, k]


@njit(cache=True, error_model="numpy", parallel=True)
def _each_parallel(what, matrix, links, inverse, up, down, right, guess, rest, fine, first, end):
    for chunk in prange((end - first + CHUNK - 1) // CHUNK):
        begin = first + CHUNK * chunk
        _each_row(what, matrix, links, inverse, up, down, right, guess, rest, fine, begin, min(end, begin + CHUNK))


@njit(cache=True, error_model="numpy")
def _each_row(what, matrix, links, inverse, up, down, right, guess, rest, fine, first, end):
    for i in range(first, end):
        if what == _DOWN_SMOOTH:
            r0, r1, r2 = right[i, 0], right[i, 1], right[i, 2]
            for k in range(3):
                guess[i, k] = _DAMPING * (inverse[i, k, 0] * r0 + inverse[i, k, 1] * r1 + inverse[i, k, 2] * r2)
        elif what == _DOWN_RESIDUAL:
            a, b, c = row_times(matrix, i, guess)
            d, e, f = apply_links_transposed(links, i)
            rest[i, 0], rest[i, 1], rest[i, 2] = right[i, 0] - a - d, right[i, 1] - b - e, right[i, 2] - c - f
        elif what == _DOWN_RESTRICT:
            a = b = c = 0.0
            for k in range(down.starts[i - fine], down.starts[i - fine + 1]):
                w, j = down.weights[k], down.columns[k]
                a += w * rest[j, 0]
                b += w * rest[j, 1]
                c += w * rest[j, 2]
            right[i, 0], right[i, 1], right[i, 2] = a, b, c
        elif what == _UP_ADD:
            for k in range(up.starts[i], up.starts[i + 1]):
                w, j = up.weights[k], up.columns[k]
                guess[i, 0] += w * guess[j, 0]
                guess[i, 1] += w * guess[j, 1]
                guess[i, 2] += w * guess[j, 2]
        else:
            a, b, c = row_times(matrix, i, guess)
            d, e, f = apply_links_transposed(links, i)
            a, b, c = right[i, 0] - a - d, right[i, 1] - b - e, right[i, 2] - c - f
            for k in range(3):
                rest[i, k] = _DAMPING * (inverse[i, k, 0] * a + inverse[i, k, 1] * b + inverse[i, k, 2] * c)


@njit(cache=True, error_model="numpy")
def _solve_coarsest(levels, first, end):
    size = 3 * (end - first)
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += levels.coarsest[i, j] * levels.right[first + j // 3, j % 3]
        levels.guess[first + i // 3, i % 3] = total
