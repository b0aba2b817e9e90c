"""How much of what the photos see has depth."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan.photos.neighbours import camera_points, visibility

STRAY_PERCENT = 1.0
"""Points beyond these percentiles of a photo's points do not widen its region [%]."""


def covered_share(maps: DepthMaps, cloud: PointCloud) -> float:
    """Return the share of the seen region that has depth, over all photos.

    The region of a photo is the convex hull of the sparse points that it sees. Each of them was matched in several
    photos, so what lies between them was in view of several, too: dense stereo had its chance there. Structure from
    motion placed the points without any depth map.

    Args:
        maps: Depth that several photos confirm.
        cloud: Sparse points in the same frame.

    Returns:
        Between 0 and 1; 0 where no photo sees three points.
    """
    import cv2

    seen = visibility(CameraSet(maps.names, maps.intrinsics, maps.world_from_cam), cloud)
    region = covered = 0
    for camera, pose, depth, visible in zip(maps.intrinsics, maps.world_from_cam, maps.depth, seen, strict=True):
        if visible.sum() < 3:
            continue
        local = camera_points(cloud.points[visible], pose)
        pixels = local[:, :2] / local[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        low, high = np.percentile(pixels, [STRAY_PERCENT, 100 - STRAY_PERCENT], axis=0)
        hull = cv2.convexHull(np.clip(pixels, low, high).round().astype(np.int32))
        mask = np.zeros((camera.height, camera.width), np.uint8)
        cv2.fillConvexPoly(mask, hull, 1)
        region += int(mask.sum())
        covered += int(((depth[: camera.height, : camera.width] > 0) & (mask > 0)).sum())
    return covered / region if region else 0.0
