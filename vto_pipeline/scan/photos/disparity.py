"""Semi-global matching of one rectified pair, giving depth in both photos from one match."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.model.settings import Config
from vto_pipeline.scan.photos.rectify import Rectification, StereoView, depth_in_view, warp
from vto_pipeline.scan.photos.subpixel import refine_disparity


class MatchConfig(Config):
    """Settings of OpenCV's semi-global block matching."""

    block: int = Field(default=3, ge=3, le=11, description="Side of the compared block [px], odd")
    smoothness: float = Field(
        default=0.8, gt=0, le=10, description="Scale of the penalties P1 = 8 block², P2 = 32 block²"
    )
    uniqueness_percent: int = Field(
        default=8, ge=0, le=50, description="By how much the best match must beat the second [%]"
    )
    refine_radius: int = Field(default=2, ge=1, le=10, description="Half side of the refinement's first window [px]")
    widest_radius: int = Field(
        default=6, ge=1, le=20, description="Half side of its widest window, for faint prints [px]"
    )
    precision_px: float = Field(
        default=0.1, gt=0, le=1, description="A disparity's standard error above which the window grows [px]"
    )
    refine_steps: int = Field(default=3, ge=0, le=20, description="Steps of the refinement; 0 leaves it out")
    min_correlation: float = Field(default=0.5, ge=-1, le=1, description="Windows that correlate less do not match")
    speckle_px: int = Field(
        default=60, ge=0, le=10_000, description="Patches of fewer pixels are dropped; 0 keeps all [px]"
    )


def match_pair(
    first: StereoView, second: StereoView, frame: Rectification, config: MatchConfig
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Match two views and return depth in each.

    Hirschmüller 2008 (semi-global matching), in OpenCV's three-way form.

    Args:
        first, second: Views.
        frame: Their rectification.
        config: Settings.

    Returns:
        Depth along the axis of the first and of the second view [m], shapes (H, W); 0 where unknown.
    """
    import cv2

    left, right = warp(first, frame, 0), warp(second, frame, frame.min_disparity)
    matcher = cv2.StereoSGBM.create(
        minDisparity=0,
        numDisparities=frame.disparities,
        blockSize=config.block,
        P1=round(8 * config.smoothness * config.block**2),
        P2=round(32 * config.smoothness * config.block**2),
        disp12MaxDiff=1,
        preFilterCap=31,
        uniquenessRatio=config.uniqueness_percent,
        speckleWindowSize=config.speckle_px,
        speckleRange=2,
        mode=cv2.StereoSGBM_MODE_SGBM_3WAY,
    )
    even = _evenly_exposed(left, right, first.exposure / second.exposure)
    fixed = matcher.compute(*even)  # in sixteenths of a pixel; negative where unknown
    seen = (fixed >= 0) & (left > 0)
    forward = np.where(seen, fixed / np.float32(16) + np.float32(frame.min_disparity), np.float32(np.nan))
    if config.refine_steps:
        radius, widest = config.refine_radius, max(config.refine_radius, config.widest_radius)
        limits = (config.refine_steps, config.min_correlation, config.precision_px)
        forward = refine_disparity(left, right, forward, frame.min_disparity, radius, widest, *limits)
    backward = _in_second(forward, frame.min_disparity)
    return depth_in_view(first, frame, forward, second=False), depth_in_view(second, frame, backward, second=True)


def _evenly_exposed(
    left: NDArray[np.uint8], right: NDArray[np.uint8], ratio: float
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return two windows with the brighter one darkened, for the matcher compares their grey levels themselves: a step
    between them costs as much at every disparity, and beside it the best hardly differs from the second."""

    def darkened(window: NDArray[np.uint8], by: float) -> NDArray[np.uint8]:
        return np.where(window > 0, np.maximum(np.rint(window / by), 1), 0).astype(np.uint8)

    return (darkened(left, ratio), right) if ratio > 1.0 else (left, darkened(right, 1.0 / ratio))


@njit(cache=True, nogil=True)
def _in_second(forward, shift):  # type: ignore[no-untyped-def]  # typed by Numba
    """Disparity (H, W) of the second window: neighbours of the first are joined by a line, the nearest wins."""
    height, width = forward.shape
    backward = np.full((height, width), np.float32(np.nan), dtype=np.float32)
    for row in range(height):
        for u in range(width - 1):
            d0, d1 = forward[row, u], forward[row, u + 1]
            if not abs(d1 - d0) <= 1.0:  # unknown (NaN), or a jump
                continue
            start, end = u - d0 + shift, u + 1 - d1 + shift
            if end <= start:
                continue
            for k in range(max(0, int(np.ceil(start))), min(width - 1, int(np.floor(end))) + 1):
                d = np.float32(d0 + (d1 - d0) * (k - start) / (end - start))
                if not backward[row, k] >= d:
                    backward[row, k] = d
    return backward
