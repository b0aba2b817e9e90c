"""A direct solver for symmetric matrices of 3 x 3 blocks that share one pattern."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from vto_pipeline.numerics.linear.block_matrix import BlockMatrix
from vto_pipeline.numerics.linear.cholesky import allocate_factor, factorise
from vto_pipeline.numerics.linear.elimination import plan_elimination
from vto_pipeline.numerics.linear.elimination_tree import dissection
from vto_pipeline.numerics.linear.substitution import solve


class DirectSolver:
    """Cholesky's factorisation, planned once for a pattern.

    Args:
        matrix: The pattern; symmetric, with N rows. Its blocks are not read.
    """

    def __init__(self, matrix: BlockMatrix) -> None:
        numba.get_num_threads()  # starts them: a kernel from the cache whose callees are parallel does not, and crashes
        self._starts = matrix.starts
        self._weights, self._links = np.empty((0, 4)), np.empty((0, 3, 3))
        order = dissection(matrix.starts, matrix.columns)
        self._plan = plan_elimination(matrix.starts, matrix.columns, order, np.empty((0, 4), np.int32), self._weights)
        self._factor = allocate_factor(self._plan)

    def factorise(self, blocks: NDArray[np.float64]) -> bool:
        """Factor a matrix of these blocks, shape (B, 3, 3); return whether it is positive definite."""
        self._factor.good[:] = False
        return bool(factorise(self._plan, self._starts, blocks, self._weights, self._links, self._factor))

    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the solution of A x = right, shapes (N, 3), with the matrix that was factored last."""
        x = np.empty_like(right)
        solve(self._plan, self._factor, right, x)
        return x
