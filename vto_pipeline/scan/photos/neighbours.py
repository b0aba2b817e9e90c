"""Choice of photo pairs that see the same surface from directions that suit stereo."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.mesh import PointCloud

FACING_COS = 0.5
"""A point counts as seen up to 60 degrees away from the direction its normal gives."""

BEST_ANGLE_DEG, ANGLE_SPREAD_DEG = 14.0, 8.0
"""Wider pairs measure depth better, narrower pairs match more surely; the best compromise and how fast it falls off."""

MIN_ANGLE_DEG = 3.0
"""Points that two photos see under a smaller angle do not count: so small a baseline, or one towards the points, tells
no depth. The limit of COLMAP's dense stereo (Schönberger et al. 2016)."""


def camera_points(points: FloatArray, world_from_cam: FloatArray) -> FloatArray:
    """Points in the frame of one camera, shape (N, 3)."""
    return (points - world_from_cam[:3, 3]) @ world_from_cam[:3, :3]


def visibility(cameras: CameraSet, cloud: PointCloud) -> NDArray[np.bool_]:
    """Guess which sparse points each photo sees: in the picture, and facing the camera.

    Args:
        cameras: Posed photos.
        cloud: Sparse points; normals, where there are any, point towards the cameras that saw them.

    Returns:
        Shape (C, N).
    """
    seen = np.empty((len(cameras.names), len(cloud.points)), dtype=bool)
    for index, (camera, pose) in enumerate(zip(cameras.intrinsics, cameras.world_from_cam, strict=True)):
        local = camera_points(cloud.points, pose)
        depth = np.where(local[:, 2] > 0, local[:, 2], np.inf)
        u = camera.fx * local[:, 0] / depth + camera.cx
        v = camera.fy * local[:, 1] / depth + camera.cy
        inside = (local[:, 2] > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        if cloud.normals is not None:
            towards = pose[:3, 3] - cloud.points
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
            inside &= (towards * cloud.normals).sum(1) > FACING_COS
        seen[index] = inside
    return seen


def choose_pairs(
    cameras: CameraSet, cloud: PointCloud, seen: NDArray[np.bool_], per_photo: int, min_shared: int
) -> list[tuple[int, int]]:
    """Pairs for stereo: each photo's best neighbours by shared points, weighted by the angle between their rays.

    The angle depends on the baseline's length and on its direction, point by point: along the line through both cameras
    it is zero.

    Returns:
        Sorted pairs (i, j), i < j.
    """
    centers = cameras.world_from_cam[:, :3, 3]
    count = len(centers)
    score = np.zeros((count, count))
    for i, j in combinations(range(count), 2):
        both = seen[i] & seen[j]
        if both.sum() < min_shared:
            continue
        a, b = cloud.points[both] - centers[i], cloud.points[both] - centers[j]
        cosine = (a * b).sum(1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
        angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
        weight = np.exp(-0.5 * ((angle - BEST_ANGLE_DEG) / ANGLE_SPREAD_DEG) ** 2)
        score[i, j] = score[j, i] = weight[angle >= MIN_ANGLE_DEG].sum()
    pairs = set()
    for i in range(count):
        best = np.argsort(-score[i], kind="stable")[:per_photo]
        pairs |= {(min(i, int(j)), max(i, int(j))) for j in best if score[i, j] > 0}
    return sorted(pairs)
