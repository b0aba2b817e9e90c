"""Where the object of a set of photos can be: round the point that all look at, and nearer to it than the cameras."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import CameraSet

NEAREST_PERCENT = 10.0
"""So many of the photos may be close-ups, taken from nearer than the region reaches [%]."""
REACH = 0.8
"""Radius of the region, in distances of the other cameras from its middle."""
CONVERGING = 0.25
"""The optical axes pass the middle at less than this share of the distance, or the photos show no one thing."""

LEVEL = 0.5
"""Photos from above tell nothing about how far to the side the object reaches: least level share of the distance."""


class Region(NamedTuple):
    """An upright cylinder.

    Args:
        x, z: Of its axis.
        radius: Of it.
    """

    x: float
    z: float
    radius: float

    def holds(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (..., 3) lie in it, shape (...)."""
        return np.hypot(points[..., 0] - self.x, points[..., 2] - self.z) <= self.radius


def object_region(cameras: CameraSet) -> Region | None:
    """Return where the object can be; None where the cameras do not look at one thing from the side.

    What is as far from it as the cameras themselves is furniture, a wall, or the floor they stand on.

    Args:
        cameras: In a frame with +Y up.
    """
    centers, ahead = cameras.world_from_cam[:, :3, 3], cameras.world_from_cam[:, :3, 2]
    across = np.eye(3) - ahead[:, :, None] * ahead[:, None, :]
    system = across.sum(axis=0)
    if len(centers) < 3 or np.linalg.cond(system) > 1e4:  # all look the same way
        return None
    middle = np.linalg.solve(system, np.einsum("cij,cj->i", across, centers))
    to_middle = middle - centers
    away = np.linalg.norm(to_middle, axis=1)
    forward = (to_middle * ahead).sum(axis=1)
    aside = np.linalg.norm(np.einsum("cij,cj->ci", across, to_middle), axis=1)
    if np.median(aside) > CONVERGING * np.median(away) or np.median(forward) <= 0.5 * np.median(away):
        return None
    level = np.hypot(to_middle[:, 0], to_middle[:, 2])
    if np.median(level) < LEVEL * np.median(away):
        return None
    radius = REACH * float(np.percentile(level, NEAREST_PERCENT))
    return Region(float(middle[0]), float(middle[2]), radius)
