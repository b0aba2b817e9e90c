"""The highest frequency of a cloth, which bounds the step of every explicit method."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import to_scipy


def highest_mode(model: ClothModel, positions: FloatArray) -> tuple[float, FloatArray]:
    """Return ω_max [rad/s] and its mode, of unit length, shape (V, 3): K φ = ω² M φ at these positions [m].

    Dense, for hundreds of vertices: all that this bench asks for, and exact to rounding however stiff.

    Args:
        model: The cloth.
        positions: Where its stiffness is taken [m], shape (V, 3).
    """
    free = np.repeat(model.inverse_mass > 0.0, 3)
    scale = np.sqrt(np.repeat(model.inverse_mass, 3))[free]
    stiffness = to_scipy(Stiffness(model).assemble(positions)).toarray()[np.ix_(free, free)]
    mode = np.zeros(len(free))
    if not free.any():
        return 0.0, mode.reshape(-1, 3)
    last = len(scale) - 1
    values, vectors = scipy.linalg.eigh(scale[:, None] * stiffness * scale, subset_by_index=[last, last])
    mode[free] = scale * vectors[:, 0]
    return float(np.sqrt(max(values[0], 0.0))), (mode / np.linalg.norm(mode)).reshape(-1, 3)
