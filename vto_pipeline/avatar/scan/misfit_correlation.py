"""Correlation of the misfit between neighbours, which separates missing shape from noise."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray

_NEAREST_M, _FARTHEST_M = 0.012, 0.020
"""Apart enough that a surface through noisy points does not tie them together, near enough to lie on one fold."""
_SAME_SIDE = 0.7
_CLIP = 3.0


def morans_i(points: FloatArray, normals: FloatArray, wrong: FloatArray) -> float:
    """Return the correlation of signed distances at neighbouring points, 1 to about 0; nan without neighbours.

    Moran's I (Moran 1950, Notes on continuous stochastic phenomena), with every pair of a band of distances alike.

    Args:
        points: [m], shape (N, 3).
        normals: Unit, shape (N, 3).
        wrong: Signed distances there [m], shape (N,).
    """
    spread = 1.48 * np.median(np.abs(wrong))
    wrong = np.clip(wrong, -_CLIP * spread, _CLIP * spread)  # a spike is neither
    pairs = cKDTree(points).query_pairs(_FARTHEST_M, output_type="ndarray")
    one, other = pairs[:, 0], pairs[:, 1]
    apart = np.linalg.norm(points[one] - points[other], axis=1)
    kept = (apart > _NEAREST_M) & ((normals[one] * normals[other]).sum(axis=1) > _SAME_SIDE)
    if not kept.any():
        return float("nan")
    return float((wrong[one] * wrong[other])[kept].mean() / ((wrong**2).mean() + 1e-30))
