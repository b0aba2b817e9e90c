"""Turn two photos so that matching points lie on the same row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics


@dataclass(frozen=True)
class StereoView:
    """One photo as stereo sees it.

    Args:
        gray: Shape (H, W), uint8.
        camera: Of this picture, distortion included.
        world_from_cam: Rigid transform [m], shape (4, 4).
    """

    gray: NDArray[np.uint8]
    camera: Intrinsics
    world_from_cam: FloatArray


@dataclass(frozen=True)
class Rectification:
    """A common frame of two views: x along the baseline, the same focal length, one window on the scene.

    Args:
        rect_from_world: Rotation, shape (3, 3).
        focal: [px].
        baseline: [m].
        corner: Rectified pixel of the first view at the window's upper left, as (u, v).
        size: Width and height of the window [px].
        min_disparity, disparities: Range searched [px]; the second view's window is shifted by min_disparity.
    """

    rect_from_world: FloatArray
    focal: float
    baseline: float
    corner: tuple[int, int]
    size: tuple[int, int]
    min_disparity: int
    disparities: int


def rectify(first: StereoView, second: StereoView, points: FloatArray, margin: float) -> Rectification:
    """Choose the rectified frame and the window that the given scene points need.

    Args:
        first, second: Views; the second's centre becomes +x of the first's.
        points: Scene points both may see [m], shape (N, 3).
        margin: By how much the window and the range of depths reach beyond the points, as a share of their extent.

    Returns:
        The frame; `disparities` is a multiple of 16, as OpenCV wants.
    """
    step = second.world_from_cam[:3, 3] - first.world_from_cam[:3, 3]
    baseline = float(np.linalg.norm(step))
    x = step / baseline
    forward = first.world_from_cam[:3, 2] + second.world_from_cam[:3, 2]
    y = np.cross(forward, x)
    y /= np.linalg.norm(y)
    rotation = np.stack([x, y, np.cross(x, y)])
    focal = float(np.sqrt(first.camera.fx * second.camera.fx))
    local = (points - first.world_from_cam[:3, 3]) @ rotation.T
    local = local[local[:, 2] > 0]
    near, far = np.percentile(local[:, 2], [0.5, 99.5])
    reach = margin * (far - near) + 0.01 * near
    near, far = max(near - reach, 0.3 * near), far + reach
    lowest = int(np.floor(focal * baseline / far))
    count = int(np.ceil((focal * baseline / near - lowest) / 16)) * 16
    image = focal * local[:, :2] / local[:, 2:]
    low, high = np.percentile(image, [0.5, 99.5], axis=0)
    pad = margin * (high - low) + 8
    low, high = _inside_picture(first, rotation, focal, low - pad, high + pad)
    corner = (int(np.floor(low[0])) - count, int(np.floor(low[1])))  # OpenCV leaves the first `count` columns empty
    size = (int(np.ceil(high[0])) - corner[0], int(np.ceil(high[1])) - corner[1])
    return Rectification(rotation, focal, baseline, corner, size, lowest, count)


def _inside_picture(
    view: StereoView, rotation: FloatArray, focal: float, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Limit a window to the part that the picture covers."""
    camera = view.camera
    u, v = np.meshgrid(
        [0.0, (camera.width - 1) / 2, camera.width - 1], [0.0, (camera.height - 1) / 2, camera.height - 1]
    )
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], -1).reshape(-1, 3)
    local = rays @ view.world_from_cam[:3, :3].T @ rotation.T
    image = focal * local[:, :2] / local[:, 2:]
    low = np.minimum(np.maximum(low, image.min(0)), image.max(0) - 1)
    return low, np.maximum(np.minimum(high, image.max(0)), low + 1)


def warp(view: StereoView, frame: Rectification, shift: int) -> NDArray[np.uint8]:
    """The part of a photo that the window shows, moved by `shift` pixels to the left; 0 beyond the photo."""
    import cv2

    width, height = frame.size
    u, v = np.meshgrid(np.arange(width) + frame.corner[0] - shift, np.arange(height) + frame.corner[1])
    rays = np.stack([u / frame.focal, v / frame.focal, np.ones_like(u, dtype=float)], axis=-1)
    local = rays @ (frame.rect_from_world @ view.world_from_cam[:3, :3])
    x, y = local[..., 0] / local[..., 2], local[..., 1] / local[..., 2]
    bend = 1 + view.camera.k1 * (x * x + y * y)
    map_x = (view.camera.fx * x * bend + view.camera.cx).astype(np.float32)
    map_y = (view.camera.fy * y * bend + view.camera.cy).astype(np.float32)
    warped: NDArray[Any] = cv2.remap(view.gray, map_x, map_y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    return warped


def depth_in_view(
    view: StereoView, frame: Rectification, disparity: NDArray[np.float32], shift: int
) -> NDArray[np.float32]:
    """Depth for each pixel of the undistorted view from a disparity map of the window.

    Args:
        view: One of the two views.
        frame: Their rectification.
        disparity: Full disparity of the window's pixels [px], NaN where unknown.
        shift: As given to `warp`.

    Returns:
        Depth along the view's axis [m], shape (H, W); 0 where unknown.
    """
    import cv2

    camera = view.camera
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u, dtype=float)], axis=-1)
    local = rays @ (frame.rect_from_world @ view.world_from_cam[:3, :3]).T
    map_x = (frame.focal * local[..., 0] / local[..., 2] - frame.corner[0] + shift).astype(np.float32)
    map_y = (frame.focal * local[..., 1] / local[..., 2] - frame.corner[1]).astype(np.float32)
    nan = float("nan")
    smooth = cv2.remap(disparity, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=nan)
    nearest = cv2.remap(disparity, map_x, map_y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=nan)
    known = (np.abs(smooth - nearest) < 1) & (smooth > 0)  # across a jump, the mean of both sides is neither
    depth = frame.focal * frame.baseline / np.where(known, smooth, 1) / local[..., 2]
    return np.where(known, depth, 0).astype(np.float32)
