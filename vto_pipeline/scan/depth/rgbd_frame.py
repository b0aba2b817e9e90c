"""A depth frame made ready for alignment: smaller, smooth, with normals and brightness.

Readings are fitted by planes in inverse depth, over a small window: there a plane is an affine function of the pixel,
and the steps of a disparity sensor are even, so that the fit is unbiased where averaging depths is not. The plane gives
the depth, without the steps, and the normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.camera import Intrinsics

WIDTH = 320
"""Frames are brought to about this width [px]: finer detail is below the noise of readings."""

REACH = 2
"""The window reaches this many pixels of the smaller frame to each side."""

STEEPEST = 3.0
"""Readings of a window that differ by more than a surface this steep (tangent) are not of one surface."""

GRAZING_COS = 0.25
"""Surfaces seen more obliquely take no part."""

MIN_SHARE = 0.3
"""Least share of the window that has readings."""


@dataclass(frozen=True)
class RgbdFrame:
    """One frame, prepared for alignment.

    Args:
        camera: Of the smaller frame.
        depth: Of the fitted planes [m], shape (H, W); 0 where there is none.
        normals: Unit, towards the camera, shape (H, W, 3); 0 where there is no depth.
        brightness: 0 to 1, shape (H, W); 0 everywhere without colour.
    """

    camera: Intrinsics
    depth: NDArray[np.float32]
    normals: NDArray[np.float32]
    brightness: NDArray[np.float32]


def prepare_frame(color: ByteArray | None, depth: NDArray[np.float32], camera: Intrinsics) -> RgbdFrame:
    """Fit planes to a frame's readings.

    Args:
        color: Registered to the depth, shape (H, W, 3), or None.
        depth: [m], shape (H, W); 0 where there is no reading.
        camera: Of the frame.
    """
    import cv2

    factor = max(1, round(camera.width / WIDTH))
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    fitted, normals = _fit_planes(np.ascontiguousarray(depth), lens, factor)
    small = camera.reduced(factor)
    brightness = np.zeros(fitted.shape, np.float32)
    if color is not None:
        gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)[: small.height * factor, : small.width * factor]
        shrunk = cv2.resize(gray.astype(np.float32) / 255, (small.width, small.height), interpolation=cv2.INTER_AREA)
        brightness = np.asarray(cv2.GaussianBlur(shrunk, (0, 0), 0.8), dtype=np.float32)
    return RgbdFrame(small, fitted, normals, brightness)


@njit(cache=True, nogil=True)
def _fit_planes(depth, lens, factor):  # type: ignore[no-untyped-def]  # typed by Numba
    """Depth (h, w) and normals (h, w, 3) of planes fitted in inverse depth; a small pixel is `factor` wide."""
    height, width = depth.shape[0] // factor, depth.shape[1] // factor
    fitted = np.zeros((height, width), dtype=np.float32)
    normals = np.zeros((height, width, 3), dtype=np.float32)
    half = 0.5 * (factor - 1)
    reach = REACH * factor
    needed = MIN_SHARE * (2 * REACH * factor + 1) ** 2
    spread = 2.0 * (REACH * factor / 2.0) ** 2
    for row in range(height):
        for column in range(width):
            middle, found, count = 0.0, 0, 0.0
            for i in range(row * factor, (row + 1) * factor):
                for j in range(column * factor, (column + 1) * factor):
                    z = depth[i, j]
                    if z > 0:
                        middle += 1.0 / z
                        found += 1
            if 2 * found < factor * factor:
                continue
            middle /= found
            u0, v0 = column * factor + half, row * factor + half
            gate = STEEPEST * middle / lens[0]  # per pixel
            n = su = sv = suu = suv = svv = sw = suw = svw = 0.0
            for i in range(int(np.ceil(v0 - reach)), int(np.floor(v0 + reach)) + 1):
                for j in range(int(np.ceil(u0 - reach)), int(np.floor(u0 + reach)) + 1):
                    if i < 0 or j < 0 or i >= depth.shape[0] or j >= depth.shape[1] or depth[i, j] == 0:
                        continue
                    du, dv = j - u0, i - v0
                    w = 1.0 / depth[i, j] - middle
                    if abs(w) > gate * (1.0 + np.sqrt(du * du + dv * dv)):
                        continue
                    k = np.exp(-(du * du + dv * dv) / spread)
                    count += 1.0
                    n += k
                    su += k * du
                    sv += k * dv
                    suu += k * du * du
                    suv += k * du * dv
                    svv += k * dv * dv
                    sw += k * w
                    suw += k * du * w
                    svw += k * dv * w
            if count < needed:
                continue
            mu, mv, mw = su / n, sv / n, sw / n
            cuu, cuv, cvv = suu / n - mu * mu, suv / n - mu * mv, svv / n - mv * mv
            cuw, cvw = suw / n - mu * mw, svw / n - mv * mw
            det = cuu * cvv - cuv * cuv
            if det < 0.05 * (cuu + cvv) ** 2:  # the readings are in a line
                continue
            b, c = (cvv * cuw - cuv * cvw) / det, (cuu * cvw - cuv * cuw) / det
            a = middle + mw - b * mu - c * mv
            if a <= 0:
                continue
            x, y = b * lens[0], c * lens[1]  # the plane: x X + y Y + z Z = 1
            z = a + b * (lens[2] - u0) + c * (lens[3] - v0)
            size = np.sqrt(x * x + y * y + z * z)
            ray_x, ray_y = (u0 - lens[2]) / lens[0], (v0 - lens[3]) / lens[1]
            away = np.sqrt(ray_x * ray_x + ray_y * ray_y + 1.0) / a
            if GRAZING_COS * size * away > 1.0:
                continue
            fitted[row, column] = 1.0 / a
            normals[row, column, 0], normals[row, column, 1], normals[row, column, 2] = -x / size, -y / size, -z / size
    return fitted, normals
