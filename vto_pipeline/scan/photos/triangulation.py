"""Points in space from their pixels in several photos."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.camera import CameraSet, Intrinsics


def triangulate_points(
    found: list[tuple[IntArray, FloatArray]], cameras: CameraSet, max_error_px: float
) -> tuple[IntArray, FloatArray]:
    """Find where marked corners are: the point nearest to all rays that see it.

    Args:
        found: Per photo: corner ids (K,), and pixels (K, 2).
        cameras: The photos' poses.
        max_error_px: Corners that half of their photos miss by more are left out [px].

    Returns:
        Ids (K,) of the corners that two photos or more see, and their places in the cameras' frame (K, 3).
    """
    sightings: dict[int, list[tuple[int, FloatArray]]] = {}
    for index, (ids, seen) in enumerate(found):
        for identity, pixel in zip(ids, seen, strict=True):
            sightings.setdefault(int(identity), []).append((index, pixel))
    kept, points = [], []
    for identity in sorted(sightings):
        photo = np.array([p for p, _ in sightings[identity]])
        if len(photo) < 2:
            continue
        pixels = np.array([pixel for _, pixel in sightings[identity]])
        directions = np.array([_ray(cameras.intrinsics[p], x) for p, x in zip(photo, pixels, strict=True)])
        directions = np.einsum("nij,nj->ni", cameras.world_from_cam[photo, :3, :3], directions)
        across = np.eye(3) - directions[:, :, None] * directions[:, None, :]  # nearest point to all rays
        system = across.sum(0)
        if np.linalg.cond(system) > 1e4:  # the rays are all but parallel
            continue
        point = np.linalg.solve(system, np.einsum("nij,nj->i", across, cameras.world_from_cam[photo, :3, 3]))
        reach = point - cameras.world_from_cam[photo, :3, 3]
        miss = np.linalg.norm(np.einsum("nij,nj->ni", across, reach), axis=1) / np.linalg.norm(reach, axis=1)
        if np.median(miss) * cameras.intrinsics[photo[0]].fx <= max_error_px:
            kept.append(identity)
            points.append(point)
    return np.array(kept, np.int32), np.array(points).reshape(-1, 3)


def _ray(camera: Intrinsics, pixel: FloatArray) -> FloatArray:
    """Unit direction of a pixel in the camera's frame; the distortion is undone by a few fixed-point steps."""
    bent = np.array([(pixel[0] - camera.cx) / camera.fx, (pixel[1] - camera.cy) / camera.fy])
    flat = bent
    for _ in range(10):
        flat = bent / (1 + camera.k1 * (flat @ flat))
    direction = np.array([*flat, 1.0])
    return np.asarray(direction / np.linalg.norm(direction))
