"""Cloth that keeps its shape as far as what some of it is asked for allows.

As rigidly as possible (Sorkine & Alexa 2007, "As-rigid-as-possible surface modeling"): the surroundings of each vertex
turn as they like, and lengths hardly change.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import diags
from scipy.sparse.linalg import splu

from vto_pipeline.cloth.placement.transfer import divergence, nearest_rotations
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_FIRM = 0.05  # m: over this length along the cloth, a wish of weight 1 outweighs keeping shape


class Rigidity:
    """A garment whose parts move nearly rigidly.

    Args:
        garment: In the shape that it is to keep [m].
    """

    def __init__(self, garment: TriangleMesh) -> None:
        self._garment = garment
        self._matrix, self._area = laplacian(garment)
        edge = self._matrix.tocoo()
        apart = edge.row != edge.col
        self._i, self._j, self._stiffness = edge.row[apart], edge.col[apart], -edge.data[apart]
        self._pull = np.zeros(0)

    def follow(self, positions: FloatArray, wanted: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the positions that keep the turns of the given ones, and go where they are wanted [m], shape (V, 3).

        Args:
            positions: [m], shape (V, 3).
            wanted: [m], shape (V, 3).
            weight: Of each such wish, shape (V,); every connected piece needs one above zero.
        """
        pull = self._area / _FIRM**2 * weight
        turned = divergence(self._garment, self._matrix, self._turns(positions))
        if not np.array_equal(pull, self._pull):
            self._pull, self._factor = pull, splu((self._matrix + diags(pull)).tocsc())
        return np.asarray(self._factor.solve(turned + pull[:, None] * wanted))

    def _turns(self, positions: FloatArray) -> FloatArray:
        """Return how the surroundings of each vertex are turned from the garment to positions [m], shape (V, 3, 3)."""
        was, i, j = self._garment.vertices, self._i, self._j
        spread = np.zeros((len(positions), 3, 3))
        now = self._stiffness[:, None] * (positions[i] - positions[j])
        np.add.at(spread, i, now[:, :, None] * (was[i] - was[j])[:, None, :])
        return nearest_rotations(spread)
