"""How a depth camera moved between two frames, however far, from matched SIFT features that have depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics

RATIO, MAX_ERROR_PX, MIN_MATCHES = 0.8, 2.0, 25
"""Lowe's ratio, the reprojection error of an inlier, and how few inliers may be chance."""

FEATURES, CONTRAST = 2000, 0.01
"""So many of the strongest features are kept, even faint ones: OpenCV's own limit, 0.04, drops a pastel print."""


@dataclass(frozen=True)
class ImageFeatures:
    """SIFT features of one frame.

    Args:
        pixels: Shape (K, 2).
        points: The same in the camera's frame [m], shape (K, 3); z = 0 where there is no reading.
        descriptors: Shape (K, 128); OpenCV's are whole numbers up to 255.
    """

    pixels: FloatArray
    points: FloatArray
    descriptors: NDArray[np.float32] | NDArray[np.uint8]


def find_features(color: ByteArray | None, depth: NDArray[np.float32], camera: Intrinsics) -> ImageFeatures:
    """Detect features (Lowe 2004) and look up their depth; without colour there are none."""
    import cv2

    none = ImageFeatures(np.empty((0, 2)), np.empty((0, 3)), np.empty((0, 128), np.uint8))
    if color is None:
        return none
    seen = cv2.dilate((depth > 0).astype(np.uint8), np.ones((5, 5), np.uint8))
    sift = cv2.SIFT.create(FEATURES, contrastThreshold=CONTRAST)
    found, descriptors = sift.detectAndCompute(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), seen)
    if descriptors is None:
        return none
    pixels = np.array([key.pt for key in found], dtype=float)
    column, row = np.round(pixels).astype(int).T
    z = depth[np.clip(row, 0, depth.shape[0] - 1), np.clip(column, 0, depth.shape[1] - 1)].astype(float)
    flat = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    return ImageFeatures(
        pixels, np.column_stack([flat, np.ones(len(flat))]) * z[:, None], np.asarray(descriptors).astype(np.uint8)
    )


def clear_matches(
    source: NDArray[np.float32] | NDArray[np.uint8], target: NDArray[np.float32] | NDArray[np.uint8]
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Return the descriptors of one frame whose nearest in another is clearly nearer than the second, and that nearest.

    By one matrix product, which is exact for OpenCV's descriptors: their squares add up to less than 2^24.

    Args:
        source: Shape (K, 128).
        target: Shape (L, 128), L >= 2.
    """
    one, other = source.astype(np.float32), target.astype(np.float32)
    apart_sq = (other**2).sum(axis=1) - 2.0 * (one @ other.T)  # and the square of one, which is the same along a row
    rows = np.arange(len(one))
    nearest = np.argmin(apart_sq, axis=1)
    first = apart_sq[rows, nearest].copy()
    apart_sq[rows, nearest] = np.inf
    own = (one**2).sum(axis=1)
    clear = np.flatnonzero(own + first < RATIO**2 * (own + apart_sq.min(axis=1)))
    return clear, nearest[clear]


def guess_motion(source: ImageFeatures, target: ImageFeatures, camera: Intrinsics) -> FloatArray | None:
    """Estimate target_from_source by perspective-n-point with RANSAC.

    Returns:
        Rigid transform, shape (4, 4), or None where too few features agree on one.
    """
    import cv2

    if min(len(source.pixels), len(target.pixels)) < MIN_MATCHES:
        return None
    a, b = clear_matches(source.descriptors, target.descriptors)
    near = source.points[a, 2] > 0
    matched = np.hstack([source.points[a], target.pixels[b]])[near]
    matched = matched[np.sort(np.unique(matched, axis=0, return_index=True)[1])]  # SIFT: a row for each orientation
    if len(matched) < MIN_MATCHES:
        return None
    cv2.setRNGSeed(0)
    try:
        found, turn, shift, inliers = cv2.solvePnPRansac(
            matched[:, :3], matched[:, 3:], camera.matrix, None,
            iterationsCount=500, reprojectionError=MAX_ERROR_PX, confidence=0.999, flags=cv2.SOLVEPNP_SQPNP,
        )  # fmt: skip
    except cv2.error:  # a sample without extent, which SQPnP refuses: the features are all but in one place
        return None
    if not found or inliers is None or len(inliers) < MIN_MATCHES:
        return None
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
    return transform
