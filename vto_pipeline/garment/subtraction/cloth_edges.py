"""Edges of cloth on a mannequin: the scan steps down there, by how far the cloth lies off, to the bare mannequin.

Where cloth and mannequin have one colour, tight cloth passes for bare, too. But cloth comes close by and by: its
distance goes on growing from where it stands out of the noise. Behind an edge the cloth lies as far off as farther in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.mesh import TriangleMesh

STATION = 0.015
"""A rim is looked at in stretches of about this length [m]."""
BESIDE_RIM = 0.012
"""Rims are cleaned: the label boundary that they come from is this near [m]."""
BEFORE, BEHIND, FARTHER = (1.0, 4.0), (2.0, 4.0), (5.0, 8.0)
"""From the label boundary: the bare mannequin, the cloth at its edge, and farther in [edge lengths of the scan]."""
SHARP = 0.75
"""Of the cloth's distance farther in, an edge has so much already; tight cloth had 0.4 to 0.65."""
LEAST_READ = 3
"""Vertices on each side of a stretch."""
THICKNESS, DEVIATIONS = 0.0005, 3.0
"""A step is higher than cloth is thick, and than so many deviations of the bare mannequin's noise [m]."""


class ClothEdges:
    """Tells edges of cloth from borders between labels that lie within cloth.

    Args:
        surface: The scan in the mannequin's frame.
        labels: Of its vertices.
        distance: Signed, of its vertices to the mannequin [m], shape (V,).
        touching: What was labelled bare is nearer to the mannequin than this [m].
    """

    def __init__(self, surface: TriangleMesh, labels: SurfaceLabels, distance: FloatArray, touching: float) -> None:
        pair = edges(surface)
        across = pair[labels.garment[pair[:, 0]] != labels.garment[pair[:, 1]]]
        self._border = surface.vertices[across].mean(axis=1)
        self._edge = float(np.median(edge_lengths(surface)))
        bare = ~labels.garment & (np.abs(distance) < touching)
        self._usual = float(np.median(distance[bare])) if bare.any() else 0.0
        self._noise = 1.4826 * float(np.median(np.abs(distance[bare] - self._usual))) if bare.any() else np.inf
        self._least = THICKNESS + DEVIATIONS * self._noise
        used = labels.garment | bare
        self._distance, self._cloth = distance[used], labels.garment[used]
        self._away, self._nearest = np.full(int(used.sum()), np.inf), np.zeros(int(used.sum()), dtype=int)
        if len(self._border):
            self._away, self._nearest = cKDTree(self._border).query(surface.vertices[used])

    def along(self, rim: FloatArray) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return along which stretches of a loop both sides of its border were scanned, and which are edges of cloth.

        Args:
            rim: A loop in order [m], shape (L, 3).

        Returns:
            Two masks of its stretches, each of about the same length, shape (S,).
        """
        length = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=1)
        count = max(int(np.ceil(length.sum() / STATION)), 1)
        stretch = np.minimum((np.cumsum(length) - 0.5 * length) / length.sum() * count, count - 1).astype(int)
        if len(self._border) == 0:
            return np.zeros(count, dtype=bool), np.zeros(count, dtype=bool)
        away, at = cKDTree(rim).query(self._border)
        mine = np.where(away < BESIDE_RIM, stretch[at], -1)[self._nearest]
        before, behind, farther = (
            self._medians(mine, count, cloth, *span)
            for cloth, span in ((False, BEFORE), (True, BEHIND), (True, FARTHER))
        )
        read = np.isfinite(before) & np.isfinite(behind) & np.isfinite(farther)
        step, whole = behind - before, farther - before
        high = step > self._least
        low = np.abs(before - self._usual) < self._noise
        return read, read & high & low & (step > SHARP * whole)

    def _medians(self, stretch: NDArray[np.int_], count: int, cloth: bool, least: float, most: float) -> FloatArray:
        """Return the median distance to the mannequin in a band beside each stretch [m], NaN where it was not read."""
        band = (stretch >= 0) & (self._cloth == cloth)
        band &= (self._away >= least * self._edge) & (self._away < most * self._edge)
        found = np.full(count, np.nan)
        for number in range(count):
            there = self._distance[band & (stretch == number)]
            if len(there) >= LEAST_READ:
                found[number] = np.median(there)
        return found
