"""Attachments: vertices held at fixed or moving places, with a compliance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.cloth.constraints.points.combination import Combination, combinations


def attachments(
    vertices: ArrayLike,
    targets: ArrayLike,
    positions: NDArray[np.float64],
    compliance: ArrayLike,
    damping: float = 0.0,
) -> Combination:
    """Return attachments of vertices to places.

    To move the places, give a model the same attachments made with the new ones.

    Args:
        vertices: Shape (N,).
        targets: Where they are held [m], shape (N, 3).
        positions: Of all vertices [m], shape (V, 3).
        compliance: [m/N], shape (N,) or one for all; zero is rigid, for solvers that can take it.
        damping: Rayleigh's β [s].
    """
    held = np.asarray(vertices, dtype=np.int32)
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(held), 1))
    places = np.asarray(targets, dtype=np.float64).reshape(-1, 3)
    return combinations(np.repeat(held[:, None], 4, axis=1), weights, places, compliance, positions, damping)
