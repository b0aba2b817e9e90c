"""Linear systems of an implicit step: conjugate gradients where low accuracy suffices, else elimination.

Cloth that hangs freely needs a few cycles of multigrid. Contacts are another matter. Which of them push is read off the
solution, so it has to be good; and folds bend easily and stretch hardly, which no coarse grid of a multigrid says, so
that takes hundreds of cycles. A sparse Cholesky factorisation takes as long as 15 to 30, and is exact.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix, row_times
from vto_pipeline.numerics.linear.cholesky import Factor, allocate_factor, factorise
from vto_pipeline.numerics.linear.conjugate_gradients import pcg
from vto_pipeline.numerics.linear.elimination import Elimination, plan_elimination
from vto_pipeline.numerics.linear.elimination_tree import dissection, with_links
from vto_pipeline.numerics.linear.links import apply_links, apply_links_transposed, make_links
from vto_pipeline.numerics.linear.multigrid import Hierarchy, hierarchy, update_hierarchy
from vto_pipeline.numerics.linear.substitution import solve

_ROUGH = 30  # cycles, at most
_MANY = 200  # where the solution has to be good and elimination is out of the question
_MOST = 1e11  # flops of a factorisation that is not worth it
_DEARER = 1.5  # times the flops that the order was made for: then another is looked for


class LinearSystem:
    """Systems A x = b with one pattern, and links beside it that come and go.

    Args:
        matrix: The pattern. Its blocks are not read.
        held: Rows that are an identity, shape (N,).

    Attributes:
        levels: The first of them is A, with its links; the coarser ones are up to date only inside `solve`.
    """

    levels: Hierarchy

    def __init__(self, matrix: BlockMatrix, held: NDArray[np.bool_]) -> None:
        self._bare = hierarchy(matrix, held)
        self._starts, self._columns = matrix.starts, matrix.columns
        self._order: NDArray[np.int32] | None = None
        self._foreseen = np.inf  # flops, when the order was made
        self._plan: Elimination | None = None
        self._room: Factor | None = None
        self._planned: tuple[NDArray[np.int32], NDArray[np.bool_]] | None = None
        self.uncouple()

    @property
    def blocks(self) -> FloatArray:
        """The blocks of A, to be written, shape (B, 3, 3)."""
        return self._bare.matrix.blocks[: self._bare.slots[1]]

    def uncouple(self) -> None:
        """Leave A alone."""
        self.couple(np.empty((0, 4), np.int32), np.empty((0, 4)))

    def couple(self, vertices: NDArray[np.int32], weights: NDArray[np.float64]) -> FloatArray:
        """Set what is coupled beside A: rows and their weights, shape (P, 4).

        Returns:
            The links' blocks, to be written, shape (P, 3, 3).
        """
        self._linked = vertices, weights
        self.levels = self._bare
        if len(vertices) > 0:
            self.levels = self._bare._replace(links=make_links(vertices, weights, self._bare.up, self._bare.rows[:2]))
        return self.levels.links.blocks

    def parabola(self, right: FloatArray, x: FloatArray) -> float:
        """Return ½ xᵀ A x - xᵀ right, shapes (N, 3)."""
        return float(_parabola(self.levels.matrix, self.levels.links, right, x))

    @property
    def eliminates(self) -> bool:
        """Whether elimination is worth it, with what is coupled now."""
        return self._up_to_date().flops <= _MOST

    def solve(
        self, right: FloatArray, x: FloatArray, reference: FloatArray, tolerance: float, *, exactly: bool
    ) -> None:
        """Solve A x = right.

        Args:
            right: Shape (N, 3).
            x: First guess, and the solution, shape (N, 3).
            reference, tolerance: When cycles are enough; see `pcg`.
            exactly: Whether the solution is wanted to rounding, if that can be had.
        """
        if exactly and self.eliminated(right, x):
            return
        blocks = self.levels.links.blocks
        if len(blocks) > 0:  # on all levels now
            self.levels = self._bare._replace(links=make_links(*self._linked, self._bare.up, self._bare.rows))
            self.levels.links.blocks[:] = blocks
        update_hierarchy(self.levels)
        pcg(self.levels, right, x, reference, tolerance, _MANY if exactly else _ROUGH, True)

    def eliminated(self, right: FloatArray, x: FloatArray) -> bool:
        """Set x to the solution of A x = right, shapes (N, 3), by elimination.

        Returns:
            False where that is not worth it, or A is not positive definite.
        """
        plan = self._up_to_date()
        if plan.flops > _MOST:
            return False
        self._room = allocate_factor(plan, self._room)
        if not factorise(plan, self._starts, self.blocks, self._linked[1], self.levels.links.blocks, self._room):
            return False
        solve(plan, self._room, right, x)
        return True

    def substitute(self, right: FloatArray) -> FloatArray:
        """Return the solution for another right side, shape (N, 3), with the factor that `eliminated` left."""
        x = np.empty_like(right)
        solve(self._plan, self._room, right, x)
        return x

    def _up_to_date(self) -> Elimination:
        """Return the plan for the links of now."""
        vertices, weights = self._linked
        used = weights != 0.0
        if self._plan is not None and self._planned is not None:
            before, were = self._planned
            if np.array_equal(before, vertices) and np.array_equal(were, used):
                return self._plan
        if self._order is None:
            self._order = dissection(self._starts, self._columns)
        plan = plan_elimination(self._starts, self._columns, self._order, vertices, weights)
        self._foreseen = min(self._foreseen, plan.flops) if self._plan is None else self._foreseen
        if plan.flops > _DEARER * self._foreseen:
            order = dissection(*with_links(self._starts, self._columns, vertices, weights))
            other = plan_elimination(self._starts, self._columns, order, vertices, weights)
            if other.flops < plan.flops:
                self._order, plan = order, other
            self._foreseen = plan.flops
        self._plan, self._planned = plan, (vertices.copy(), used)
        return plan


@njit(cache=True, error_model="numpy")
def _parabola(matrix, links, right, x):
    total = 0.0
    apply_links(links, 0, x)
    for i in range(len(x)):
        a, b, c = row_times(matrix, i, x)
        d, e, f = apply_links_transposed(links, i)
        total += x[i, 0] * (0.5 * (a + d) - right[i, 0])
        total += x[i, 1] * (0.5 * (b + e) - right[i, 1])
        total += x[i, 2] * (0.5 * (c + f) - right[i, 2])
    return total
