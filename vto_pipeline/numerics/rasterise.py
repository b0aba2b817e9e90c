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
    draw_rows(corners, 0, face, weight, depth)
    return face, weight, depth


@njit(cache=True)
def draw_rows(corners, first, face, weight, depth):  # type: ignore[no-untyped-def]  # typed by Numba
    """Draw triangles into some rows of a depth buffer, from row `first` on; the rest is as of `rasterise`."""
    rows, width = face.shape
    for f in range(len(corners)):
        ay, by, cy = corners[f, 0, 1], corners[f, 1, 1], corners[f, 2, 1]
        begin = max(first, int(np.ceil(min(ay, by, cy))))
        end = min(first + rows, int(np.floor(max(ay, by, cy))) + 1)
        if begin >= end:
            continue
        ax, bx, cx = corners[f, 0, 0], corners[f, 1, 0], corners[f, 2, 0]
        az, bz, cz = corners[f, 0, 2], corners[f, 1, 2], corners[f, 2, 2]
        twice_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if twice_area == 0.0:
            continue
        for row in range(begin, end):
            for col in range(max(0, int(np.ceil(min(ax, bx, cx)))), min(width, int(np.floor(max(ax, bx, cx))) + 1)):
                v = ((col - ax) * (cy - ay) - (cx - ax) * (row - ay)) / twice_area
                w = ((bx - ax) * (row - ay) - (col - ax) * (by - ay)) / twice_area
                if v < 0.0 or w < 0.0 or v + w > 1.0:
                    continue
                z = az + v * (bz - az) + w * (cz - az)
                if z < depth[row - first, col]:
                    depth[row - first, col] = z
                    face[row - first, col] = f
                    weight[row - first, col, 0] = v
                    weight[row - first, col, 1] = w
