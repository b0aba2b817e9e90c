"""Smoothing around crossings that pushing does not resolve."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from vto_pipeline.model.arrays import FloatArray, IntArray


def smoothed(positions: FloatArray, laplacian: csr_matrix, centre: IntArray, rings: int) -> FloatArray:
    """Return the positions with harmonic ones about the centre: each vertex a mean of its neighbours.

    Pieces of which nothing would stay stay as they are.

    Args:
        positions: [m], shape (V, 3).
        laplacian: Of the cloth as it started, shape (V, V).
        centre: Vertices, any shape.
        rings: How many rings of neighbours move with them.
    """
    near = np.zeros(len(positions))
    near[centre] = 1.0
    for _ in range(rings - 1):
        near = (abs(laplacian) @ near > 0.0).astype(np.float64)
    pieces, piece = connected_components(laplacian, directed=False)
    ends = np.bincount(piece[near == 0.0], minlength=pieces) > 0  # a piece without them would shrink to a point
    free = (near > 0.0) & ends[piece]
    result = positions.copy()
    if free.any():
        rows = laplacian[free]
        result[free] = spsolve(rows[:, free].tocsc(), -(rows[:, ~free] @ positions[~free])).reshape(-1, 3)
    return result
