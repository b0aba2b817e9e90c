"""Where the scan saw the mannequin bare: no cloth can have been there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.garment.subtraction.cloth_edges import ClothEdges
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

LEAST_EDGE, OF_READ = 0.2, 0.5
"""A loop is where cloth ends if a larger share of it is an edge of cloth, and of what was scanned on both sides."""


class BareParts:
    """What the scan saw of the bare mannequin.

    Args:
        surface: The scan in the mannequin's frame.
        labels: Of its vertices.
        mannequin: The mannequin.
    """

    def __init__(self, surface: TriangleMesh, labels: SurfaceLabels, mannequin: TriangleMesh) -> None:
        self._distance = SurfaceDistance(mannequin)
        away = self._distance.signed(surface.vertices).distance
        sure = ~labels.garment & (labels.confidence > CONFIDENT) & (np.abs(away) < TOUCHING)
        self._bare = cKDTree(surface.vertices[sure])
        self._edges = ClothEdges(surface, labels, away, TOUCHING)

    def under(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which points (N, 3) lie over a place of the mannequin that was seen bare, shape (N,)."""
        if self._bare.n == 0:
            return np.zeros(len(points), dtype=bool)
        foot = self._distance.nearest(points).point
        return np.asarray(np.isfinite(self._bare.query(foot, distance_upper_bound=BESIDE)[0]))

    def ends_cloth(self, rim: FloatArray) -> float:
        """Return along which share of a loop (L, 3) cloth was seen to end, and the bare mannequin beyond; 0 where that
        is too little to tell, or less than elsewhere along it where both sides were scanned."""
        read, edge = self._edges.along(rim)
        share = float(edge.mean())
        return share if share > LEAST_EDGE and edge.sum() > OF_READ * read.sum() else 0.0
