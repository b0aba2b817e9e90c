"""Morton order: points near in space are near in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def morton_order(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the indices of the points in Morton order; equal codes keep their order. Points of shape (N, 3)."""
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-300)
    cell = np.minimum((points - low) / size * 1023.0, 1023.0).astype(np.uint64)
    code = _spread(cell[:, 0]) | _spread(cell[:, 1]) << np.uint64(1) | _spread(cell[:, 2]) << np.uint64(2)
    return np.argsort(code, kind="stable").astype(np.int32)


def _spread(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return ten bits with two zeros after each."""
    for shift, mask in ((16, 0xFF0000FF), (8, 0x0F00F00F), (4, 0xC30C30C3), (2, 0x49249249)):
        bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
    return bits
