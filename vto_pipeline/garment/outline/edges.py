"""Photos as edges: gradients at several sizes, and the depth of what was scanned, which hides what is behind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import in_order

MAX_PHOTOS = 40
"""So many are enough for an outline, and fit in memory; more are thinned evenly."""
MAX_SIDE = 1000
"""Photos are scaled down to this longer side [px]."""
LEVELS = 4
"""Sizes, each half of the one before."""
NOISE_GRADIENTS = 4.0
"""An edge counts half when it is so many times as strong as the median gradient of its photo."""
LEAST_GRADIENT = 1.0
"""The median of a photo without noise is no scale [grey levels per pixel]."""
GAP = 0.05
"""The scan hides through gaps up to this share of its size: they are holes of the scan, not of the garment."""
RIM = 0.012
"""It hides so far beyond its rims, too, where it lost the last of the cloth [share of its size]."""


@dataclass(frozen=True)
class EdgeLevel:
    """One photo at one size.

    Args:
        camera: Without distortion.
        gradient: Of the channel that changes most, along columns and rows [grey levels per pixel], (H, W, 2).
        half: Gradient of an edge that counts half [grey levels per pixel].
        hidden: Depth of the scan, gaps bridged, infinite for none, in the scan's unit, shape (H, W).
    """

    camera: Intrinsics
    gradient: NDArray[np.float32]
    half: float
    hidden: NDArray[np.float32]


@dataclass(frozen=True)
class EdgePhoto:
    """A photo from fine to coarse.

    Args:
        name: File name.
        cam_from_scan: Rigid, shape (4, 4).
        levels: Each half the size of the one before.
    """

    name: str
    cam_from_scan: FloatArray
    levels: tuple[EdgeLevel, ...]


def load_edges(paths: Sequence[Path], cameras: CameraSet, scan: TriangleMesh) -> tuple[EdgePhoto, ...]:
    """Read posed photos as edges, side by side.

    Args:
        paths: Of the photos; those without a camera are left out.
        cameras: In the scan's frame and unit.
        scan: Surface that hides what is behind it.
    """
    at = {path.name: path for path in paths}
    usable = [k for k, name in enumerate(cameras.names) if name in at]
    chosen = np.unique(np.linspace(0, len(usable) - 1, min(len(usable), MAX_PHOTOS)).round().astype(int))
    size = float(np.linalg.norm(np.ptp(np.percentile(scan.vertices, [2, 98], axis=0), axis=0)))

    def load(number: int) -> EdgePhoto:
        k = usable[chosen[number]]
        picture = undistorted(read_image(at[cameras.names[k]]), cameras.intrinsics[k])
        camera = cameras.intrinsics[k].resized(picture.shape[1], picture.shape[0]).without_distortion()
        cam_from_scan: FloatArray = np.asarray(np.linalg.inv(cameras.world_from_cam[k]), dtype=np.float64)
        local = scan.vertices @ cam_from_scan[:3, :3].T + cam_from_scan[:3, 3]
        return EdgePhoto(cameras.names[k], cam_from_scan, _levels(picture, camera, local, size))

    return tuple(in_order(load, len(chosen)))


def _levels(picture: ByteArray, camera: Intrinsics, local: FloatArray, size: float) -> tuple[EdgeLevel, ...]:
    """A photo without distortion at all sizes, with the scan in its camera's frame, (N, 3), and the scan's size."""
    import cv2

    scale = min(1.0, MAX_SIDE / max(picture.shape[:2]))
    levels = []
    for level in range(LEVELS):
        wide, high = (max(round(side * scale / 2**level), 8) for side in (camera.width, camera.height))
        small: Any = cv2.resize(picture, (wide, high), interpolation=cv2.INTER_AREA) if scale < 1 or level else picture
        lens = camera.resized(wide, high)
        gradient = _gradient(small)
        usual = float(np.median(np.linalg.norm(gradient, axis=2)))
        half = NOISE_GRADIENTS * max(usual, LEAST_GRADIENT)
        levels.append(EdgeLevel(lens, gradient, half, _hidden(local, lens, size)))
    return tuple(levels)


def _gradient(picture: ByteArray) -> NDArray[np.float32]:
    """Derivatives of a Gaussian of one pixel, of the channel that changes most, shape (H, W, 2)."""
    import cv2

    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 1.0)
    x, y = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=1, scale=0.5) for order in ((1, 0), (0, 1)))
    strongest = np.argmax(x * x + y * y, axis=2)[..., None]
    both = [np.take_along_axis(way, strongest, axis=2)[..., 0] for way in (x, y)]
    return np.ascontiguousarray(np.stack(both, axis=-1))


def _hidden(local: FloatArray, camera: Intrinsics, size: float) -> NDArray[np.float32]:
    """Depth of a cloud with its gaps closed and its rims widened, infinite for none, shape (H, W)."""
    import cv2

    depth = _splat(local, camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    seen = np.isfinite(depth)
    if not seen.any():
        return depth
    pixels = size * camera.fx / float(np.median(depth[seen]))

    def disc(share: float) -> NDArray[np.uint8]:
        reach = max(round(share * pixels), 1)
        return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2), dtype=np.uint8)

    border = round(GAP * pixels) + 1  # else the closing would reach out of the picture
    mask = cv2.copyMakeBorder(seen.astype(np.uint8), border, border, border, border, cv2.BORDER_CONSTANT)
    mask = cv2.dilate(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, disc(GAP / 2)), disc(RIM))
    near = cv2.erode(depth, disc(GAP / 2 + RIM))
    return np.where(mask[border:-border, border:-border] > 0, near, np.float32(np.inf))


@njit(cache=True, nogil=True)
def _splat(local, fx, fy, cx, cy, width, height):  # type: ignore[no-untyped-def]  # typed by Numba
    """Nearest depth of the points (N, 3) that fall in each pixel, infinite for none, shape (H, W), float32."""
    depth = np.full((height, width), np.float32(np.inf), dtype=np.float32)
    for n in range(len(local)):
        z = local[n, 2]
        if z <= 0:
            continue
        column = int(np.round(fx * local[n, 0] / z + cx))
        row = int(np.round(fy * local[n, 1] / z + cy))
        if 0 <= column < width and 0 <= row < height and z < depth[row, column]:
            depth[row, column] = z
    return depth
