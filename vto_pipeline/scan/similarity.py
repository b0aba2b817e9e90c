"""The similarity that maps one set of points on another."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray


def fit_similarity(source: FloatArray, target: FloatArray) -> tuple[float, FloatArray]:
    """Least-squares scale and rigid transform, target ≈ R (scale · source) + t.

    Umeyama 1991, eqs. 34-43.

    Args:
        source, target: Matching points, shape (N, 3), N >= 3, not on one line.

    Returns:
        Scale, and the rigid transform, shape (4, 4).
    """
    a, b = source - source.mean(0), target - target.mean(0)
    u, s, vt = np.linalg.svd(b.T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    transform = np.eye(4)
    transform[:3, :3] = (u * sign) @ vt
    scale = float((s * sign).sum() / (a * a).sum())
    transform[:3, 3] = target.mean(0) - scale * transform[:3, :3] @ source.mean(0)
    return scale, transform
