"""A guess at the up axis and the front, from how cameras are held."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray


def upright_from_scan(world_from_cam: FloatArray, points: FloatArray) -> FloatArray:
    """Rigid transform to a frame with +Y up, the first camera in front (+Z), the floor under the lowest points.

    People hold cameras level and walk round: the mean of the cameras' up directions is up.

    Args:
        world_from_cam: Poses in the scan's arbitrary frame, shape (C, 4, 4).
        points: Points of the scene in it, shape (N, 3).

    Returns:
        Shape (4, 4). y = 0 is at the 0.1 % lowest point; x = z = 0 at the middle of the points.
    """
    up = -world_from_cam[:, :3, 1].mean(0)
    up /= np.linalg.norm(up)
    middle = np.median(points, axis=0)
    front = world_from_cam[0, :3, 3] - middle
    front -= up * (front @ up)
    if np.linalg.norm(front) < 1e-9:  # the camera looks straight down
        front = world_from_cam[0, :3, 1] - up * (world_from_cam[0, :3, 1] @ up)
    front /= np.linalg.norm(front)
    transform = np.eye(4)
    transform[:3, :3] = np.stack([np.cross(up, front), up, front])
    moved = points @ transform[:3, :3].T
    transform[:3, 3] = -np.array([np.median(moved[:, 0]), np.percentile(moved[:, 1], 0.1), np.median(moved[:, 2])])
    return transform
