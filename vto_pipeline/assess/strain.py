"""Stretch of the cloth relative to its rest shape."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray

_NO_AREA = 1e-14  # [m²]


def principal_stretches(positions: FloatArray, rest: FloatArray, faces: IntArray) -> FloatArray:
    """Return the largest and the smallest stretch of each face, 1 where it is at rest, shape (F, 2).

    The singular values of the deformation gradient F = Ds Dm⁻¹, from the right Cauchy-Green tensor C = FᵀF
    (Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, section 4.4). A face without rest
    area counts as unstretched.

    Args:
        positions: Vertices now [m], shape (V, 3).
        rest: Vertices at rest [m], shape (V, 3).
        faces: Shape (F, 3).
    """
    now, was = (p[faces[:, 1:]] - p[faces[:, :1]] for p in (positions, rest))  # (F, 2 edges, 3)
    length = np.linalg.norm(was[:, 0], axis=1)
    twice_area = np.linalg.norm(np.cross(was[:, 0], was[:, 1]), axis=1)
    flat = twice_area < _NO_AREA
    length, twice_area = np.where(flat, 1.0, length), np.where(flat, 1.0, twice_area)
    along = np.einsum("fd,fd->f", was[:, 0], was[:, 1]) / length
    # rest edges in the face's own frame: (length, 0) and (along, twice_area / length); F's columns follow
    first = now[:, 0] / length[:, None]
    second = (now[:, 1] - along[:, None] * first) * (length / twice_area)[:, None]
    cxx, cyy, cxy = (np.einsum("fd,fd->f", a, b) for a, b in ((first, first), (second, second), (first, second)))
    mean, spread = 0.5 * (cxx + cyy), np.hypot(0.5 * (cxx - cyy), cxy)
    stretches = np.sqrt(np.maximum(np.stack([mean + spread, mean - spread], axis=1), 0.0))
    return np.where(flat[:, None], 1.0, stretches)


def summarise_stretch(largest: FloatArray, areas: FloatArray, limit: float) -> dict[str, float]:
    """Return the stretch over the cloth's area as shares of rest length: median, p95, max, area beyond the limit.

    Args:
        largest: Largest principal stretch of each face, shape (F,).
        areas: Rest area of each face [m²], shape (F,).
        limit: Stretch beyond rest that counts as too much, such as 0.05.
    """
    strain = largest - 1.0
    median, p95 = np.quantile(strain, [0.5, 0.95], weights=areas, method="inverted_cdf")
    over = areas[strain > limit].sum() / areas.sum()
    return {
        "median": float(median),
        "p95": float(p95),
        "max": float(strain.max()),
        "limit": limit,
        "share_over_limit": float(over),
    }
