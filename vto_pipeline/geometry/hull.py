"""The convex hull of points of a plane: the path of a taut tape, which bridges hollows (ISO 8559-1, girths)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from vto_pipeline.model.arrays import FloatArray

_INSIDE = 1e-9  # [m]


@dataclass(frozen=True)
class Hull:
    """The shortest closed path around points of a plane.

    Args:
        perimeter: Its length [m].
        corners: Where it touches, in order, plane coordinates [m], shape (K, 2).
        sides: Outward normal and offset of each side, shape (K, 3); a point p is inside where sides · (p, 1) <= 0.
    """

    perimeter: float
    corners: FloatArray
    sides: FloatArray

    @property
    def center(self) -> FloatArray:
        """Middle of the bounding box [m], shape (2,)."""
        return 0.5 * (self.corners.min(axis=0) + self.corners.max(axis=0))

    def encloses(self, point: FloatArray) -> bool:
        """Whether a point of the plane, shape (2,), is inside."""
        return bool((self.sides[:, :2] @ point + self.sides[:, 2] <= _INSIDE).all())


def plane_axes(normal: FloatArray) -> FloatArray:
    """Return two unit vectors that span the plane of a normal, shape (2, 3)."""
    across = np.zeros(3)
    across[np.argmin(np.abs(normal))] = 1.0
    first = np.cross(normal, across)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    return np.stack([first, second / np.linalg.norm(second)])


def convex_hull(points: FloatArray) -> Hull | None:
    """Return the hull of points of a plane, shape (N, 2) [m]; None when they do not span an area."""
    if len(points) < 3:
        return None
    try:
        hull = ConvexHull(points)
    except QhullError:  # all on one line
        return None
    return Hull(float(hull.area), points[hull.vertices], hull.equations)  # in 2D, Qhull's area is the perimeter
