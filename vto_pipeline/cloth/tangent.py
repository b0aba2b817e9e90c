"""The exact stiffness of a cloth, indefinite where it is about to buckle: differences of its forces.

Columns whose vertices no force shares are found together (Curtis, Powell & Reid 1974), so the number of force
evaluations does not grow with the cloth. Unlike the stiffness of an implicit step, nothing is left out to keep it
positive: this is what vibration, buckling and the last steps to an equilibrium need.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csc_array

from vto_pipeline.cloth.build import ClothModel
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.stiffness import Stiffness
from vto_pipeline.model.arrays import FloatArray

_STEP = 1e-5  # of an edge: the error of central differences is its square, rounding a hundred-thousandth of an angle


class Tangent:
    """The exact stiffness -∂f/∂x over the free vertices.

    Args:
        model: The cloth.
        stiffness: Its approximate stiffness, for the pattern.

    Attributes:
        free: Free vertices, shape (N,); row 3 i + k of the matrix is component k of free[i].
    """

    def __init__(self, model: ClothModel, stiffness: Stiffness) -> None:
        matrix = stiffness.assemble(np.zeros((len(model.mass), 3)))
        self.free = np.flatnonzero(model.inverse_mass > 0.0)
        self._model = model
        self._starts, self._columns = matrix.starts, matrix.columns
        self._colour = _colours(matrix.starts, matrix.columns)
        number = np.full(len(model.mass), -1)
        number[self.free] = np.arange(len(self.free))
        row = np.repeat(np.arange(len(model.mass)), np.diff(matrix.starts))
        self._kept = np.flatnonzero((number[row] >= 0) & (number[matrix.columns] >= 0))
        self._row, self._column = number[row[self._kept]], number[matrix.columns[self._kept]]
        self._from, self._to = row[self._kept], matrix.columns[self._kept]

    def assemble(self, x: FloatArray) -> csc_array:
        """Return the stiffness [N/m] at positions x [m], shape (V, 3); symmetric, shape (3N, 3N)."""
        blocks = self._differences(x)
        size = 3 * len(self.free)
        rows = 3 * self._row[:, None, None] + np.arange(3)[None, :, None] + np.zeros((1, 1, 3), np.int64)
        columns = 3 * self._column[:, None, None] + np.arange(3)[None, None, :] + np.zeros((1, 3, 1), np.int64)
        matrix = csc_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
        return csc_array(0.5 * (matrix + matrix.T))

    def add_to(self, blocks: FloatArray, x: FloatArray) -> None:
        """Add the stiffness at positions x [m], shape (V, 3), to the blocks of the pattern, shape (B, 3, 3)."""
        blocks[self._kept] += self._differences(x)

    def _differences(self, x: FloatArray) -> FloatArray:
        """Return the blocks of free vertices, in the order of the pattern."""
        step = _STEP * self._model.edge_length
        blocks = np.zeros((len(self._kept), 3, 3))
        order = np.argsort(self._colour[self._to], kind="stable")
        bounds = np.searchsorted(self._colour[self._to][order], np.arange(self._colour.max() + 2))
        for colour in range(len(bounds) - 1):
            chosen = order[bounds[colour] : bounds[colour + 1]]
            if len(chosen) == 0:
                continue
            moved = (self._colour == colour) & (self._model.inverse_mass > 0.0)
            for k in range(3):
                change = np.zeros_like(x)
                change[moved, k] = step
                ahead, behind = np.zeros_like(x), np.zeros_like(x)
                add_forces(x + change, self._model.constraints, ahead)
                add_forces(x - change, self._model.constraints, behind)
                blocks[chosen, :, k] = (behind - ahead)[self._from[chosen]] / (2.0 * step)
        return blocks


@njit(cache=True)
def _colours(starts, columns):  # type: ignore[no-untyped-def]
    """Return a colour of each vertex such that no row of the pattern holds two columns of one colour."""
    count = len(starts) - 1
    colour = np.full(count, -1, np.int64)
    seen = np.full(count + 1, -1, np.int64)
    for j in range(count):
        for a in range(starts[j], starts[j + 1]):
            i = columns[a]
            for b in range(starts[i], starts[i + 1]):
                if colour[columns[b]] >= 0:
                    seen[colour[columns[b]]] = j
        free = 0
        while seen[free] == j:
            free += 1
        colour[j] = free
    return colour


def lumped_mass(model: ClothModel, free: NDArray[np.int64]) -> FloatArray:
    """Return the diagonal of the mass matrix over these vertices [kg], shape (3N,)."""
    return np.repeat(model.mass[free], 3)
