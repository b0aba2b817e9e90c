"""Rasterisation: the visible triangle of each pixel."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def rasterise(
    corners: NDArray[np.float64], width: int, height: int
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
    """Draw triangles into a depth buffer. Where two are equally near, the first stays.

    A pixel belongs to a triangle when its centre is inside (edge functions, Pineda 1988).

    Args:
        corners: Pixel column, pixel row and depth of each triangle's corners, shape (F, 3, 3). Smaller depth is nearer.
        width, height: Size of the picture [px].

    Returns:
        The triangle of each pixel, -1 for none, shape (height, width); its weights at the second and third corner,
        shape (height, width, 2); the depth, infinite for none, shape (height, width).
    """
    face = np.full((height, width), -1, np.int32)
    weight = np.zeros((height, width, 2))
    depth = np.full((height, width), np.inf)
    for f in range(len(corners)):
        ax, ay, az = corners[f, 0]
        bx, by, bz = corners[f, 1]
        cx, cy, cz = corners[f, 2]
        twice_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if twice_area == 0.0:
            continue
        for row in range(max(0, int(np.ceil(min(ay, by, cy)))), min(height, int(np.floor(max(ay, by, cy))) + 1)):
            for col in range(max(0, int(np.ceil(min(ax, bx, cx)))), min(width, int(np.floor(max(ax, bx, cx))) + 1)):
                v = ((col - ax) * (cy - ay) - (cx - ax) * (row - ay)) / twice_area
                w = ((bx - ax) * (row - ay) - (col - ax) * (by - ay)) / twice_area
                if v < 0.0 or w < 0.0 or v + w > 1.0:
                    continue
                z = az + v * (bz - az) + w * (cz - az)
                if z < depth[row, col]:
                    depth[row, col] = z
                    face[row, col] = f
                    weight[row, col, 0] = v
                    weight[row, col, 1] = w
    return face, weight, depth
