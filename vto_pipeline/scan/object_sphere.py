"""Where the object is: in the middle of the cameras that look at it. What lies beyond their ring is the room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics

LEAST_SPREAD = 0.1
"""Mean squared sine of the angles between the lines of sight and their common direction; below, they are parallel."""

IN_FRONT = 0.9
"""Share of the cameras that must have the point before them."""


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Args:
        center: [m], shape (3,).
        radius: [m].
    """

    center: FloatArray
    radius: float


def object_sphere(world_from_cam: FloatArray) -> Sphere | None:
    """Return the ball about the point nearest to all lines of sight, out to the cameras, or None where there is none.

    The radius is the median distance of the cameras, and more by as much as lines of sight pass the point: who walks up
    and down along a tall object looks at many points of it.

    Args:
        world_from_cam: Poses [m], shape (C, 4, 4).
    """
    eye, way = world_from_cam[:, :3, 3], world_from_cam[:, :3, 2]
    across = np.eye(3) - way[:, :, None] * way[:, None, :]
    matrix = across.sum(0)
    if np.linalg.eigvalsh(matrix)[0] < LEAST_SPREAD * len(eye):
        return None
    center = np.linalg.solve(matrix, np.einsum("cij,cj->i", across, eye))
    to_center = center - eye
    if np.mean((to_center * way).sum(1) > 0) < IN_FRONT:  # they look outwards
        return None
    missed = np.linalg.norm(np.einsum("cij,cj->ci", across, to_center), axis=1)
    radius = np.median(np.linalg.norm(to_center, axis=1)) + np.percentile(missed, 95)
    return Sphere(center, float(radius))


def inside_sphere(
    depth: NDArray[np.float32], camera: Intrinsics, world_from_cam: FloatArray, sphere: Sphere
) -> NDArray[np.float32]:
    """Return a depth map without the readings outside a ball.

    Args:
        depth: [m], shape (H, W); 0 where there is no reading.
        camera: Of the map.
        world_from_cam: Its pose, shape (4, 4).
        sphere: The ball.
    """
    middle = world_from_cam[:3, :3].T @ (sphere.center - world_from_cam[:3, 3])
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    return np.asarray(_inside(np.ascontiguousarray(depth), lens, middle, sphere.radius))


@njit(cache=True, nogil=True)
def _inside(depth, lens, middle, radius):  # type: ignore[no-untyped-def]  # typed by Numba
    """The readings (H, W) nearer than a radius to a place in the camera's frame (3,)."""
    height, width = depth.shape
    kept = np.zeros_like(depth)
    for row in range(height):
        for column in range(width):
            z = depth[row, column]
            x, y = (column - lens[2]) / lens[0] * z - middle[0], (row - lens[3]) / lens[1] * z - middle[1]
            if x * x + y * y + (z - middle[2]) ** 2 < radius * radius:
                kept[row, column] = z
    return kept
