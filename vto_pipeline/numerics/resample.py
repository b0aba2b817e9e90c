"""Values of a picture between its pixels."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def bilinear(picture, x, y, channel):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return a channel of a picture (H, W, D) at a place [px], pixel centres whole; beyond its edge, the edge's."""
    i, j, v, u = bilinear_cell(picture.shape[0], picture.shape[1], x, y)
    above = (1.0 - u) * picture[i, j, channel] + u * picture[i, j + 1, channel]
    below = (1.0 - u) * picture[i + 1, j, channel] + u * picture[i + 1, j + 1, channel]
    return (1.0 - v) * above + v * below


@njit(cache=True)
def bilinear_cell(height, width, x, y):  # type: ignore[no-untyped-def]  # typed by Numba
    """Return between which pixels a place lies: the upper row, the left column, and how far it is beyond both [px]."""
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    i, j = min(int(y), height - 2), min(int(x), width - 2)
    return i, j, y - i, x - j


@njit(cache=True)
def bicubic(picture, x, y, channel):  # type: ignore[no-untyped-def]  # typed by Numba
    """The same by cubic convolution with a = -1/2 (Keys 1981, eq. 15), which keeps detail sharp."""
    height, width = picture.shape[:2]
    i, j = int(np.floor(y)), int(np.floor(x))
    total = 0.0
    for di in range(-1, 3):
        row = min(max(i + di, 0), height - 1)
        line = 0.0
        for dj in range(-1, 3):
            line += _cubic(x - (j + dj)) * picture[row, min(max(j + dj, 0), width - 1), channel]
        total += _cubic(y - (i + di)) * line
    return total


@njit(cache=True)
def _cubic(distance):  # type: ignore[no-untyped-def]  # typed by Numba
    s = abs(distance)
    if s < 1.0:
        return (1.5 * s - 2.5) * s * s + 1.0
    return ((-0.5 * s + 2.5) * s - 4.0) * s + 2.0
