"""Frames against each other: where one saw through, the other cannot have a surface.

Behind what a frame sees, anything may be. Before it, nothing is: points of another frame that float there contradict
it (Curless and Levoy 1996: the space between a sensor and a surface is empty). A frame that was placed wrongly is
contradicted by most of those that look the same way, and each of them only by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame
from vto_pipeline.scan.photos.consistency import rays

STRIDE = 4
"""Every so many pixels of a frame, along both axes."""
FEWEST = 100
"""Points with a say: with fewer in common, two frames tell nothing of each other."""


class Agreement(NamedTuple):
    """What two frames say of each other.

    Args:
        one, other: Their numbers, one < other.
        told: Points of either that lie on the other's surface or before it.
        against: Share of these that float before it.
    """

    one: int
    other: int
    told: int
    against: float


def compare_frames(
    frames: Sequence[RgbdFrame], poses: FloatArray, pairs: Sequence[tuple[int, int]], reach: float
) -> list[Agreement]:
    """Hold pairs of frames against each other, both ways.

    Args:
        frames: Of one camera.
        poses: world_from_cam [m], shape (N, 4, 4).
        pairs: Numbers of frames, in any order.
        reach: Farther before a surface, a point is none of it [m]; beyond a metre it grows with the square of the
            distance, as noise does.

    Returns:
        The pairs that tell enough, in order.
    """
    points = [_points(frame) for frame in frames]
    inverse = np.asarray(np.linalg.inv(poses), dtype=np.float64)
    found = []
    for one, other in sorted({(min(pair), max(pair)) for pair in pairs}):
        motion = inverse[other] @ poses[one]
        here = _before(points[one], motion, frames[other], reach)
        there = _before(points[other], np.linalg.inv(motion), frames[one], reach)
        told = here[0] + there[0]
        if told >= FEWEST:
            found.append(Agreement(one, other, told, (here[1] + there[1]) / told))
    return found


def contradicted_share(found: Sequence[Agreement], count: int) -> FloatArray:
    """Return how much each frame contradicts the others, the median over those it is compared with, shape (N,).

    Args:
        found: Comparisons.
        count: Number of frames; those without a comparison contradict nothing.
    """
    shares: list[list[float]] = [[] for _ in range(count)]
    for pair in found:
        shares[pair.one].append(pair.against)
        shares[pair.other].append(pair.against)
    return np.array([float(np.median(each)) if each else 0.0 for each in shares])


def _points(frame: RgbdFrame) -> FloatArray:
    """Return some of a frame's points in its camera, shape (P, 3)."""
    depth = frame.depth[::STRIDE, ::STRIDE]
    part = rays(frame.camera.matrix, *frame.depth.shape)[::STRIDE, ::STRIDE] * depth[..., None]
    return np.asarray(part[depth > 0], dtype=np.float64)


def _before(points: FloatArray, motion: FloatArray, target: RgbdFrame, reach: float) -> tuple[int, int]:
    """Return how many points lie on a frame's surface or before it, and how many of them before it.

    Args:
        points: In their own camera, shape (P, 3).
        motion: Target's camera from theirs, shape (4, 4).
        target: The frame.
        reach: Of the surface, at up to a metre [m].
    """
    x, y, z = (points @ motion[:3, :3].T + motion[:3, 3]).T
    ahead = z > 0
    camera, safe = target.camera, np.where(ahead, z, 1.0)
    column = np.rint(camera.fx * x / safe + camera.cx)
    row = np.rint(camera.fy * y / safe + camera.cy)
    height, width = target.depth.shape
    inside = ahead & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    seen = target.depth[row[inside].astype(int), column[inside].astype(int)]
    beyond = seen - z[inside]
    reaches = reach * np.maximum(1.0, z[inside] ** 2)
    told = (seen > 0) & (beyond > -reaches)
    return int(told.sum()), int((told & (beyond > reaches)).sum())
