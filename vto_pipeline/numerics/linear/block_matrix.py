"""Sparse symmetric matrices of 3 x 3 blocks, by rows (BSR), with the same bits for any number of threads."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.sparse import bsr_array

CHUNK = 512  # rows a thread takes at a time
PARALLEL_FROM = 2500  # rows; under it, starting the threads costs more than they save


class BlockMatrix(NamedTuple):
    """A matrix of N x N blocks.

    Args:
        starts: First block of each row, and their number, shape (N + 1,).
        columns: Column of each block, ascending in a row, shape (B,).
        blocks: Shape (B, 3, 3).
        diagonal: Place of each row's diagonal block, shape (N,).
    """

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    blocks: NDArray[np.float64]
    diagonal: NDArray[np.int32]


class Sparse(NamedTuple):
    """Scalars by rows.

    Args:
        starts: First entry of each row, and their number.
        columns, weights: Of each entry.
    """

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    weights: NDArray[np.float64]


def pattern(rows: NDArray[np.int32], columns: NDArray[np.int32], count: int) -> tuple[BlockMatrix, NDArray[np.int32]]:
    """Return a zero matrix with room for these blocks and for its diagonal, and the place of each given block.

    Args:
        rows, columns: Of the blocks, repeats allowed, shape (M,).
        count: Rows of the matrix, N.
    """
    own = np.arange(count, dtype=np.int64)
    keys = np.concatenate([rows.astype(np.int64) * count + columns, own * count + own])
    kept, place = np.unique(keys, return_inverse=True)
    starts = np.searchsorted(kept, np.arange(count + 1, dtype=np.int64) * count)
    matrix = BlockMatrix(
        starts.astype(np.int32),
        (kept % count).astype(np.int32),
        np.zeros((len(kept), 3, 3)),
        place[len(rows) :].astype(np.int32),
    )
    return matrix, place[: len(rows)].astype(np.int32)


def to_scipy(matrix: BlockMatrix) -> bsr_array:
    """Return the same matrix for SciPy, shape (3N, 3N); blocks are shared."""
    from scipy.sparse import bsr_array

    count = len(matrix.starts) - 1
    return bsr_array((matrix.blocks, matrix.columns, matrix.starts), shape=(3 * count, 3 * count))


@njit(cache=True, error_model="numpy")
def row_times(matrix, i, x):
    """Return row i of A x, with x of shape (N, 3)."""
    blocks, columns = matrix.blocks, matrix.columns
    a = b = c = 0.0
    for k in range(matrix.starts[i], matrix.starts[i + 1]):
        j = columns[k]
        x0, x1, x2 = x[j, 0], x[j, 1], x[j, 2]
        a += blocks[k, 0, 0] * x0 + blocks[k, 0, 1] * x1 + blocks[k, 0, 2] * x2
        b += blocks[k, 1, 0] * x0 + blocks[k, 1, 1] * x1 + blocks[k, 1, 2] * x2
        c += blocks[k, 2, 0] * x0 + blocks[k, 2, 1] * x1 + blocks[k, 2, 2] * x2
    return a, b, c


@njit(cache=True, error_model="numpy")
def _multiply_rows(matrix, x, out, first, last):
    for i in range(first, last):
        out[i, 0], out[i, 1], out[i, 2] = row_times(matrix, i, x)


@njit(cache=True, error_model="numpy", parallel=True)
def _multiply_parallel(matrix, x, out):
    count = len(out)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _multiply_rows(matrix, x, out, CHUNK * chunk, min(count, CHUNK * chunk + CHUNK))


@njit(cache=True, error_model="numpy")
def multiply(matrix, x, out):
    """Write A x into out, both of shape (N, 3)."""
    if len(out) >= PARALLEL_FROM:
        _multiply_parallel(matrix, x, out)
    else:
        _multiply_rows(matrix, x, out, 0, len(out))
