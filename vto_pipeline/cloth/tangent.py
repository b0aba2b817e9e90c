"""The exact stiffness of a cloth over its free vertices, as a sparse matrix: what vibration and buckling need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from vto_pipeline.cloth.build import ClothModel
from vto_pipeline.cloth.stiffness import Stiffness
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.block_matrix import to_scipy


class Tangent:
    """The exact stiffness -∂f/∂x over the free vertices.

    Args:
        model: The cloth.
        stiffness: Where it is assembled.

    Attributes:
        free: Free vertices, shape (N,); row 3 i + k of the matrix is component k of free[i].
    """

    def __init__(self, model: ClothModel, stiffness: Stiffness) -> None:
        self.free = np.flatnonzero(model.inverse_mass > 0.0)
        self._stiffness = stiffness
        self._rows = (3 * self.free[:, None] + np.arange(3)).ravel()

    def assemble(self, x: FloatArray) -> csc_array:
        """Return the stiffness [N/m] at positions x [m], shape (V, 3); symmetric, shape (3N, 3N)."""
        matrix = to_scipy(self._stiffness.assemble_exact(x)).tocsr()[self._rows][:, self._rows]
        return csc_array(0.5 * (matrix + matrix.T))


def lumped_mass(model: ClothModel, free: NDArray[np.int64]) -> FloatArray:
    """Return the diagonal of the mass matrix over these vertices [kg], shape (3N,)."""
    return np.repeat(model.mass[free], 3)
