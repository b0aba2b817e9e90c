"""Seams: a vertex held at another, or at a point on an edge or a triangle, with no distance between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.cloth.constraints.combination import Combination, combinations
from vto_pipeline.errors import InputError


def seams(
    vertices: ArrayLike,
    onto: ArrayLike,
    positions: NDArray[np.float64],
    compliance: ArrayLike,
    *,
    shares: ArrayLike | None = None,
    damping: float = 0.0,
) -> Combination:
    """Return seams.

    Args:
        vertices: Of one side, shape (N,).
        onto: Of the other: vertices, edges or triangles, shape (N, 1), (N, 2) or (N, 3).
        positions: Of all vertices [m], shape (V, 3).
        compliance: [m/N], shape (N,) or one for all; zero is rigid, for solvers that can take it.
        shares: Barycentric coordinates on the edges or triangles, the shape of `onto`; their middle when None.
        damping: Rayleigh's β [s].

    Raises:
        InputError: sizes that do not match, or shares that do not add up to one.
    """
    sewn = np.asarray(vertices, dtype=np.int32)
    other = np.asarray(onto, dtype=np.int32)
    other = other[:, None] if other.ndim == 1 else other
    count, corners = other.shape
    if len(sewn) != count or corners > 3:
        raise InputError(f"seams of {len(sewn)} vertices onto shape {other.shape}; wanted (N, 1), (N, 2) or (N, 3)")
    share = np.full(other.shape, 1.0 / corners) if shares is None else np.asarray(shares, dtype=np.float64)
    if share.shape != other.shape or not np.allclose(share.sum(axis=1), 1.0, rtol=0, atol=1e-6):
        raise InputError(f"shares of shape {share.shape}; wanted {other.shape}, each row adding up to one")
    stencils, weights = np.repeat(sewn[:, None], 4, axis=1), np.zeros((count, 4))
    stencils[:, 1 : corners + 1] = other
    weights[:, 0], weights[:, 1 : corners + 1] = 1.0, -share
    return combinations(stencils, weights, None, compliance, positions, damping)
