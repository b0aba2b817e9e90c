"""Random positive definite matrices of 3 x 3 blocks on grids, and links beside them."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, pattern, to_scipy


def sheet(count: int, rng: np.random.Generator, reach: int = 1) -> BlockMatrix:
    """Return a positive definite matrix on a grid of count x count whose rows couple neighbours up to `reach` away."""
    place = np.arange(count * count).reshape(count, count)
    near = [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)]
    ends = [
        (place[max(0, i) : count + min(0, i), max(0, j) : count + min(0, j)],
         place[max(0, -i) : count + min(0, -i), max(0, -j) : count + min(0, -j)])
        for i, j in near
    ]  # fmt: skip
    rows = np.concatenate([one.ravel() for one, _ in ends]).astype(np.int32)
    columns = np.concatenate([other.ravel() for _, other in ends]).astype(np.int32)
    matrix, _ = pattern(rows, columns, count * count)
    matrix.blocks[:] = rng.standard_normal(matrix.blocks.shape)
    whole = to_scipy(matrix).tocsr()
    whole = whole + whole.T
    whole = whole + sparse.diags_array(np.abs(whole).sum(axis=1) + 0.01)
    blocks = sparse.bsr_array(whole, blocksize=(3, 3))
    blocks.sort_indices()
    matrix.blocks[:] = blocks.data
    return matrix


def links(count: int, rows: int, rng: np.random.Generator):  # type: ignore[no-untyped-def]
    """Return vertices, weights (some of no part) and blocks of random links."""
    vertices = np.array([rng.choice(rows, 4, replace=False) for _ in range(count)], np.int32).reshape(-1, 4)
    weights = rng.standard_normal((count, 4))
    weights[::3, 3] = 0.0
    weights[::7, 1:] = 0.0
    half = rng.standard_normal((count, 3, 3))
    return vertices, weights, half @ half.transpose(0, 2, 1)


def whole(matrix: BlockMatrix, vertices, weights, between):  # type: ignore[no-untyped-def]
    """Return the matrix and its links as one, by SciPy."""
    rows, count = len(matrix.diagonal), len(vertices)
    if count == 0:
        return to_scipy(matrix).tocsr()
    gather = sparse.csr_array((weights.ravel(), (np.repeat(np.arange(count), 4), vertices.ravel())), (count, rows))
    gather = sparse.kron(gather, sparse.eye_array(3)).tocsr()
    return to_scipy(matrix).tocsr() + gather.T @ sparse.block_diag(list(between)).tocsr() @ gather
