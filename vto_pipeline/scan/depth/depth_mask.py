"""Drop unreliable depth readings: flying pixels at edges, and surfaces seen at a grazing angle.

A flying pixel sees two surfaces and lies between them. A reading of the cloth's edge has as large a jump beside it, but
lies on the plane of its neighbours. Dropped too, it would shorten every hem by two pixels, and leave of a narrow strap
nothing.
"""

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

ON_PLANE = 3.0
"""Beside a jump, a reading is of the surface when it is so many times the frame's noise from its plane, or less."""

FACING = 1.7
"""Beside a jump, the plane is first sought among readings that no steeper surface than this tangent joins."""

ROUNDS = 2
"""So often the plane is fitted again, without readings that are farther from it."""

LEAST_NOISE = 5e-4
"""No depth camera has less, as a share of the depth; what is rendered may have."""


def clean_depth(depth: NDArray[np.float32], camera: Intrinsics) -> NDArray[np.float32]:
    """Set to 0 the readings beside a jump that are of no surface there, those on grazing surfaces, and isolated ones.

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
    edge = cv2.dilate(jump.astype(np.uint8), window) > 0
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    readings = np.ascontiguousarray(depth)
    off = _off_planes(readings, known & ~edge, lens, np.inf)
    kept = np.isfinite(off)
    if not np.any(known & edge):
        return np.where(kept, depth, np.float32(0))
    noise = 1.4826 * float(np.median(np.abs(off[kept]))) if kept.any() else 0.0  # the median of a normal distribution
    bound = ON_PLANE * max(noise, LEAST_NOISE / float(np.median(depth[known])))
    kept |= np.abs(_off_planes(readings, known & edge, lens, bound)) <= bound
    return np.where(kept, depth, np.float32(0))


@njit(cache=True, nogil=True)
def _off_planes(depth, asked, lens, bound):  # type: ignore[no-untyped-def]  # typed by Numba
    """How far readings are from the planes through those around them, in inverse depth [1/m], (H, W); NaN where not
    asked, where too few readings tell, and on grazing surfaces. Readings farther off than the bound are left out."""
    height, width = depth.shape
    off = np.full(depth.shape, np.nan)
    gate = (REACH + 1) * STEEPEST / lens[0]
    for row in range(height):
        for column in range(width):
            if not asked[row, column]:
                continue
            here = depth[row, column]
            a = b = c = 0.0
            told = False
            for turn in range(1 if bound == np.inf else 1 + ROUNDS):
                n = su = sv = suu = suv = svv = sw = suw = svw = 0.0
                for i in range(max(row - REACH, 0), min(row + REACH + 1, height)):
                    for j in range(max(column - REACH, 0), min(column + REACH + 1, width)):
                        z = depth[i, j]
                        if z == 0 or abs(z - here) > gate * here:
                            continue
                        du, dv, w = j - column, i - row, here / z - 1.0
                        if turn == 0:
                            most = bound * here + FACING / lens[0] * np.sqrt(du * du + dv * dv)
                        else:
                            most = bound * here
                        if abs(w - a - b * du - c * dv) > most:
                            continue
                        n += 1.0
                        su += du
                        sv += dv
                        suu += du * du
                        suv += du * dv
                        svv += dv * dv
                        sw += w
                        suw += du * w
                        svw += dv * w
                told = n >= FEWEST
                if not told:
                    break
                cuu, cuv, cvv = suu - su * su / n, suv - su * sv / n, svv - sv * sv / n
                cuw, cvw = suw - su * sw / n, svw - sv * sw / n
                det = cuu * cvv - cuv * cuv
                told = det > 0.01 * (cuu + cvv) ** 2  # else the readings are in a line
                if not told:
                    break
                b, c = (cvv * cuw - cuv * cvw) / det, (cuu * cvw - cuv * cuw) / det
                a = (sw - b * su - c * sv) / n
            if not told:
                continue
            x, y = b * lens[0], c * lens[1]  # plane: x X + y Y + z Z = here
            ray_x, ray_y = (column - lens[2]) / lens[0], (row - lens[3]) / lens[1]
            z = 1.0 - x * ray_x - y * ray_y
            if GRAZING_COS * np.sqrt((x * x + y * y + z * z) * (ray_x * ray_x + ray_y * ray_y + 1.0)) < 1.0:
                off[row, column] = a / here
    return off
