"""Directions of a fabric's threads on each triangle of its rest shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def thread_axes(
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return unit warp and weft directions of each triangle, shape (F, 3) each, and twice its area [m²], shape (F,).

    Warp is the vertical (+Y) laid onto the triangle; where a triangle lies flat, front (+Z) takes its place.

    Args:
        corners: At rest [m], shape (F, 3, 3).
    """
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(normal, axis=1)
    normal = np.divide(normal, double_area[:, None], out=np.zeros_like(normal), where=double_area[:, None] > 0)
    up = np.broadcast_to([0.0, 1.0, 0.0], normal.shape).copy()
    up[np.abs(normal[:, 1]) > 0.95] = (0.0, 0.0, 1.0)
    warp = up - _rows_dot(up, normal)[:, None] * normal
    warp /= np.linalg.norm(warp, axis=1, keepdims=True)
    return warp, np.cross(normal, warp), double_area


def _rows_dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", a, b)
