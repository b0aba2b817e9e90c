"""Drop unreliable depth readings: flying pixels at edges, and surfaces seen at a grazing angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.photos.consistency import rays

GRAZING_COS = 0.2
"""Surfaces tilted more than 78 degrees from the line of sight measure badly."""

STEEPEST = 5.0
"""Tangent of that angle: what is steeper from one pixel to the next is no surface but a jump."""


def clean_depth(depth: NDArray[np.float32], camera: Intrinsics) -> NDArray[np.float32]:
    """Set to 0 the readings beside a jump or a gap, and those on grazing surfaces.

    Args:
        depth: [m], shape (H, W); 0 where there is no reading.
        camera: Of the frame.
    """
    import cv2

    known = depth > 0
    window = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(depth, window)
    lowest = cv2.erode(np.where(known, depth, np.float32(1e9)), window)
    jump = known & (highest - lowest > 2 * STEEPEST / camera.fx * depth)  # across the window's two steps
    edge = cv2.dilate(jump.astype(np.uint8), window) > 0
    smooth = cv2.GaussianBlur(depth, (0, 0), 2.0)
    share = cv2.GaussianBlur(known.astype(np.float32), (0, 0), 2.0)
    points = rays(camera.matrix, *depth.shape) * (smooth / np.maximum(share, 1e-6))[..., None]
    normal = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    length = np.linalg.norm(normal, axis=-1) * np.linalg.norm(points, axis=-1)
    facing = np.abs((normal * points).sum(-1)) > GRAZING_COS * length
    return np.where(known & ~edge & facing, depth, np.float32(0))
