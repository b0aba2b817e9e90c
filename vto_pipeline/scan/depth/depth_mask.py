"""Drop unreliable depth readings: flying pixels at edges, and surfaces seen at a grazing angle."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.camera import Intrinsics

GRAZING_COS = 0.2
"""Surfaces tilted more than 78 degrees from the line of sight measure badly."""

STEEPEST = 5.0
"""Tangent of that angle: what is steeper from one pixel to the next is no surface but a jump."""

REACH = 2
"""Pixels to each side whose readings tell the slope of the surface."""

FEWEST = 6
"""Readings that tell it; a pixel with fewer around it is dropped."""


def clean_depth(depth: NDArray[np.float32], camera: Intrinsics) -> NDArray[np.float32]:
    """Set to 0 the readings beside a jump, those on grazing surfaces, and isolated ones.

    Args:
        depth: [m], shape (H, W); 0 where there is no reading.
        camera: Of the frame.
    """
    import cv2

    known = depth > 0
    window = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(depth, window)
    lowest = cv2.erode(np.where(known, depth, np.float32(1e9)), window)
    jump = known & (highest - lowest > np.float32(2 * STEEPEST / camera.fx) * depth)  # across the window's two steps
    edge = cv2.dilate(jump.astype(np.uint8), window)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    return np.asarray(_facing(np.ascontiguousarray(depth), edge, lens))


@njit(cache=True, nogil=True)
def _facing(depth, edge, lens):  # type: ignore[no-untyped-def]  # typed by Numba
    """The readings (H, W) off the edges that are not on a grazing surface: a plane through those around each."""
    height, width = depth.shape
    kept = np.zeros_like(depth)
    for row in range(height):
        for column in range(width):
            here = depth[row, column]
            if here == 0 or edge[row, column]:
                continue
            gate = (REACH + 1) * STEEPEST / lens[0]
            n = su = sv = suu = suv = svv = sw = suw = svw = 0.0
            for i in range(max(row - REACH, 0), min(row + REACH + 1, height)):
                for j in range(max(column - REACH, 0), min(column + REACH + 1, width)):
                    z = depth[i, j]
                    if z == 0 or abs(z - here) > gate * here:
                        continue
                    du, dv, w = j - column, i - row, here / z - 1.0
                    n += 1.0
                    su += du
                    sv += dv
                    suu += du * du
                    suv += du * dv
                    svv += dv * dv
                    sw += w
                    suw += du * w
                    svw += dv * w
            if n < FEWEST:
                continue
            cuu, cuv, cvv = suu - su * su / n, suv - su * sv / n, svv - sv * sv / n
            cuw, cvw = suw - su * sw / n, svw - sv * sw / n
            det = cuu * cvv - cuv * cuv
            if det <= 0.01 * (cuu + cvv) ** 2:  # the readings are in a line
                continue
            b, c = (cvv * cuw - cuv * cvw) / det, (cuu * cvw - cuv * cuw) / det
            x, y = b * lens[0], c * lens[1]  # plane: x X + y Y + z Z = here
            ray_x, ray_y = (column - lens[2]) / lens[0], (row - lens[3]) / lens[1]
            z = 1.0 - x * ray_x - y * ray_y
            if GRAZING_COS * np.sqrt((x * x + y * y + z * z) * (ray_x * ray_x + ray_y * ray_y + 1.0)) < 1.0:
                kept[row, column] = here
    return kept
