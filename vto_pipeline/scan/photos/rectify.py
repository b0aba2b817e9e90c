"""Turn two photos so that matching points lie on the same row, wherever the second camera stands.

Directions are mapped as on a globe whose axis is the baseline, by Mercator's projection: rows are longitudes, that is
planes through both cameras, and along a row runs the isometric latitude. The map is conformal, and near the axis it is
log-polar, so a camera that moves forward needs no special case. Pollefeys et al. 1999 (polar rectification); Li 2008
(binocular spherical stereo).

A point at distance r from the baseline is seen in the direction (sinh m, sin l, cos l) at latitude m and longitude l.
With a baseline b, sinh m1 - sinh m2 = b / r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics

MAX_PIXELS = 2.0
"""Largest window, in pixels of the first photo; a larger one is made coarser."""

CORE = 1 / 8
"""What is nearer to the axis than this share of the window's reach is left out: the map stretches it without end."""

MIN_DISPARITY_PX = 1.0
"""A smaller disparity tells no depth."""


@dataclass(frozen=True)
class StereoView:
    """One photo as stereo sees it.

    Args:
        gray: Shape (H, W), uint8.
        camera: Of this picture, distortion included.
        world_from_cam: Rigid transform [m], shape (4, 4).
        exposure: How much brighter it shows the same things than the other photos.
    """

    gray: NDArray[np.uint8]
    camera: Intrinsics
    world_from_cam: FloatArray
    exposure: float = 1.0


@dataclass(frozen=True)
class Rectification:
    """A common map of two views, and one window on the scene.

    Args:
        rect_from_world: Rotation, shape (3, 3); x along the baseline, z to the middle of the scene points.
        scale: Pixels per radian at the equator.
        baseline: [m].
        corner: Rectified pixel of the first view at the window's upper left, as (u, v).
        size: Width and height of the window [px].
        min_disparity, disparities: Range searched [px]; the second view's window is shifted by min_disparity.
        typical_disparity: Median of the scene points [px]; depth is the surer, the larger it is.
    """

    rect_from_world: FloatArray
    scale: float
    baseline: float
    corner: tuple[int, int]
    size: tuple[int, int]
    min_disparity: int
    disparities: int
    typical_disparity: float


def rectify(first: StereoView, second: StereoView, points: FloatArray, margin: float) -> Rectification:
    """Choose the rectified frame and the window that the given scene points need.

    Args:
        first, second: Views; the second's centre becomes +x of the first's.
        points: Scene points that both may see [m], shape (N, 3).
        margin: By how much the window and the range of disparities reach beyond the points, as a share of their extent.

    Returns:
        The frame, with at most about `MAX_PIXELS` times the first photo's pixels; `disparities` is a multiple of 16, as
        OpenCV requires.

    Raises:
        ScanError: both photos were taken from one place.
    """
    step = second.world_from_cam[:3, 3] - first.world_from_cam[:3, 3]
    away = points - first.world_from_cam[:3, 3]
    baseline = float(np.linalg.norm(step))
    if baseline <= 1e-9 * np.linalg.norm(away, axis=1).max():
        raise ScanError("two photos were taken from one place")
    rotation = _rotation(step / baseline, away)
    local = away @ rotation.T
    seen = mercator(local)
    disparity = seen[:, 0] - mercator(local - [baseline, 0, 0])[:, 0]
    farthest, nearest = np.percentile(disparity, [0.5, 99.5])
    reach = margin * (nearest - farthest) + 0.01 * nearest
    farthest, nearest = farthest - reach, nearest + reach
    low, high = _window(first, rotation, seen, margin)
    width, height = high - low + [nearest - farthest, 0]
    equator = np.cosh(np.clip(0.0, low[0], high[0]))  # how much finer than at the equator the coarsest latitude is
    focal = np.sqrt(first.camera.fx * second.camera.fx)
    scale = min(focal / equator, np.sqrt(MAX_PIXELS * first.camera.width * first.camera.height / (width * height)))
    lowest = max(0, int(np.floor(scale * farthest)))
    count = max(1, int(np.ceil((scale * nearest - lowest) / 16))) * 16
    left, top = np.floor(scale * low).astype(int)
    right, bottom = np.ceil(scale * high).astype(int)
    corner = (int(left) - count, int(top))  # OpenCV leaves the first `count` columns empty
    size = (int(right) - corner[0], int(bottom) - corner[1])
    typical = float(scale * np.median(disparity))
    return Rectification(rotation, float(scale), baseline, corner, size, lowest, count, typical)


def mercator(directions: FloatArray) -> FloatArray:
    """Isometric latitude towards +x, and longitude about x from +z towards +y, of directions (..., 3) [rad]."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([np.arcsinh(x / np.maximum(np.hypot(y, z), 1e-12 * np.abs(x))), np.arctan2(y, z)], axis=-1)


def _rotation(x: FloatArray, away: FloatArray) -> FloatArray:
    """Rectified axes as rows, shape (3, 3): x given, z towards the middle of the points, so that the seam is behind."""
    middle = (away / np.linalg.norm(away, axis=1, keepdims=True)).mean(0)
    z = middle - x * (x @ middle)
    if np.linalg.norm(z) < 0.01:  # the axis goes through the middle of the points: the seam may lie anywhere
        z = np.cross(x, np.eye(3)[np.argmin(np.abs(x))])
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _window(view: StereoView, rotation: FloatArray, seen: FloatArray, margin: float) -> tuple[FloatArray, FloatArray]:
    """Lower and upper end of the part of a picture that the points, seen there (N, 2), need [rad]."""
    pixel = 1 / view.camera.fx
    low, high = np.percentile(seen, [0.5, 99.5], axis=0)
    pad = margin * (high - low) + 8 * pixel
    floor, ceiling = _reach_of_picture(view, rotation)
    low = np.minimum(np.maximum(low - pad, floor), ceiling - pixel)
    high = np.maximum(np.minimum(high + pad, ceiling), low + pixel)
    farthest = 1 / np.cosh(np.clip(0.0, low[0], high[0]))  # sine of the angle to the axis
    core = np.arccosh(1 / (CORE * farthest))
    low[0], high[0] = np.clip([low[0], high[0]], -core, core)
    return low, high


def _reach_of_picture(view: StereoView, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper end of what a picture covers [rad]: all longitudes where it shows the axis."""
    camera, share = view.camera, np.linspace(0, 1, 33)
    zero, one = np.zeros(33), np.ones(33)
    right, bottom = camera.width - 1, camera.height - 1
    u, v = np.concatenate([share, one, share, zero]) * right, np.concatenate([zero, share, one, share]) * bottom
    rect_from_cam = rotation @ view.world_from_cam[:3, :3]
    border = mercator(_rays(camera, u, v) @ rect_from_cam.T)
    low, high = border.min(0), border.max(0)
    for sign in (1, -1):
        x, y, z = sign * rect_from_cam[0]  # the axis, as the camera sees it
        if z > 0 and 0 <= camera.fx * x / z + camera.cx <= right and 0 <= camera.fy * y / z + camera.cy <= bottom:
            seam = 8 / camera.fx  # shown on both sides, so that windows of the matcher reach across it
            low[1], high[1] = -np.pi - seam, np.pi + seam
            low[0], high[0] = (low[0], np.inf) if sign > 0 else (-np.inf, high[0])
    return low, high


def _rays(camera: Intrinsics, u: FloatArray, v: FloatArray) -> FloatArray:
    """Directions of pixels of a camera without distortion, z = 1, shape (..., 3)."""
    return np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], axis=-1)


def warp(view: StereoView, frame: Rectification, shift: int) -> NDArray[np.uint8]:
    """Return the part of a photo that the window shows, moved by `shift` pixels to the left; 0 beyond the photo."""
    import cv2

    width, height = frame.size
    latitude = (np.arange(width) + frame.corner[0] - shift) / frame.scale
    longitude = (np.arange(height) + frame.corner[1]) / frame.scale
    turn = frame.rect_from_world @ view.world_from_cam[:3, :3]
    local = np.sinh(latitude)[:, None] * turn[0] + (np.sin(longitude)[:, None] * turn[1])[:, None]
    local += (np.cos(longitude)[:, None] * turn[2])[:, None]
    ahead = local[..., 2] > 1e-6
    z = np.where(ahead, local[..., 2], 1)
    x, y = local[..., 0] / z, local[..., 1] / z
    squared = x * x + y * y
    ahead &= 1 + 3 * view.camera.k1 * squared > 0  # beyond, the lens model turns back into the picture
    bend = 1 + view.camera.k1 * squared
    map_x = np.where(ahead, view.camera.fx * x * bend + view.camera.cx, -9).astype(np.float32)
    map_y = np.where(ahead, view.camera.fy * y * bend + view.camera.cy, -9).astype(np.float32)
    warped: NDArray[Any] = cv2.remap(view.gray, map_x, map_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return warped


def depth_in_view(
    view: StereoView, frame: Rectification, disparity: NDArray[np.float32], *, second: bool
) -> NDArray[np.float32]:
    """Return the depth of each pixel of the undistorted view from a disparity map of the window.

    Args:
        view: One of the two views.
        frame: Their rectification.
        disparity: Full disparity of the window's pixels [px], NaN where unknown.
        second: Whether view and window are the second photo's.

    Returns:
        Depth along the view's axis [m], shape (H, W); 0 where unknown.
    """
    import cv2

    camera, shift = view.camera, frame.min_disparity if second else 0
    u, v = np.meshgrid(np.arange(float(camera.width)), np.arange(float(camera.height)))
    local = _rays(camera, u, v) @ (frame.rect_from_world @ view.world_from_cam[:3, :3]).T
    seen = mercator(local)
    map_x, map_y = np.moveaxis(frame.scale * seen - frame.corner + [shift, 0], -1, 0).astype(np.float32)
    nan = float("nan")
    smooth = cv2.remap(disparity, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=nan)
    nearest = cv2.remap(disparity, map_x, map_y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=nan)
    known = (np.abs(smooth - nearest) < 1) & (smooth > MIN_DISPARITY_PX)  # across a jump, the mean is neither side
    angle = np.where(known, smooth, 1) / frame.scale
    latitude = seen[..., 0]
    gap = np.sinh(latitude + angle) - np.sinh(latitude) if second else np.sinh(latitude) - np.sinh(latitude - angle)
    return np.where(known, frame.baseline / gap / np.hypot(local[..., 1], local[..., 2]), 0).astype(np.float32)
