"""Where the scan saw the mannequin bare: no cloth can have been there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.mesh import TriangleMesh

CONFIDENT = 0.9
"""Labels less certain than this say nothing."""

TOUCHING = 0.003
"""The bare mannequin is scanned within this of itself [m]."""

BESIDE = 0.008
"""A place of the mannequin was seen bare where the scan has a bare point this near [m]."""


class BareParts:
    """What the scan saw of the bare mannequin.

    Args:
        surface: The scan in the mannequin's frame.
        labels: Of its vertices.
        mannequin: The mannequin.
    """

    def __init__(self, surface: TriangleMesh, labels: SurfaceLabels, mannequin: TriangleMesh) -> None:
        self._distance = SurfaceDistance(mannequin)
        sure = ~labels.garment & (labels.confidence > CONFIDENT)
        points = surface.vertices[sure]
        near = self._distance.nearest(points)
        self._bare = cKDTree(points[near.distance < TOUCHING])

    def under(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (N, 3) lie over a place of the mannequin that was seen bare, shape (N,)."""
        if self._bare.n == 0:
            return np.zeros(len(points), dtype=bool)
        foot = self._distance.nearest(points).point
        return np.asarray(np.isfinite(self._bare.query(foot, distance_upper_bound=BESIDE)[0]))
