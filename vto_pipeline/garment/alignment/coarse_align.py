"""Coarse placement of a scan on its mannequin: all translations of many rotations, scored by FFT.

The score of a placement is the sum over scan points of a field around the mannequin: positive at its surface, nothing
far outside (garment folds, floor and board cost nothing), negative inside (nothing can be there). For a given
rotation the scores of all translations are one correlation, done by FFT.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft
from scipy.spatial.transform import Rotation

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import in_order

INSIDE_PENALTY = 2.0
LARGEST_GRID = 120


def upright_rotations(count: int) -> list[FloatArray]:
    """Return rotations about +Y, evenly spread, each (3, 3)."""
    return [Rotation.from_rotvec([0.0, a, 0.0]).as_matrix() for a in np.arange(count) * 2.0 * np.pi / count]


def tilted_rotations(count: int, tilt: float) -> list[FloatArray]:
    """Return rotations that bring any of the six axes up, tilted by 0 or `tilt` [rad] four ways, at each yaw."""
    right = np.pi / 2.0
    ups = [[0, 0, 0], [right, 0, 0], [-right, 0, 0], [2 * right, 0, 0], [0, 0, right], [0, 0, -right]]
    tilts = [[0, 0, 0], [tilt, 0, 0], [-tilt, 0, 0], [0, 0, tilt], [0, 0, -tilt]]
    return [
        (Rotation.from_rotvec(t) * Rotation.from_matrix(yaw) * Rotation.from_rotvec(up)).as_matrix()
        for up in ups
        for t in tilts
        for yaw in upright_rotations(count)
    ]


class PlacementSearch:
    """Scores placements of one cloud of scan points on one mannequin.

    Args:
        points: Scan points [m], shape (N, 3).
        mannequin: The mannequin under the garment.
        distance: Its distance queries.
        cell: Wanted cell size of the score field [m].
        largest_grid: Cells along the longest side; a larger scene gets larger cells.
    """

    def __init__(
        self,
        points: FloatArray,
        mannequin: TriangleMesh,
        distance: SurfaceDistance,
        cell: float,
        largest_grid: int = LARGEST_GRID,
    ) -> None:
        self._middle = points.mean(axis=0)
        self._points = points - self._middle
        reach = np.linalg.norm(self._points, axis=1).max()  # of any rotation of the scan
        low, high = mannequin.vertices.min(axis=0), mannequin.vertices.max(axis=0)
        self._cell = max(cell, float((high - low).max() + 2.0 * reach) / largest_grid)
        margin = 2.0 * self._cell
        self._low = low - margin
        size = np.ceil((high - low + 2.0 * margin) / self._cell).astype(int)
        self._reach = int(np.ceil(reach / self._cell)) + 1
        self._shape = [fft.next_fast_len(int(s) + 2 * self._reach, real=True) for s in size]
        grid = np.stack(np.meshgrid(*(np.arange(s) for s in size), indexing="ij"), axis=-1).reshape(-1, 3)
        away = distance.signed(self._low + (grid + 0.5) * self._cell).distance
        field = np.where(away < -self._cell, -INSIDE_PENALTY, np.exp(-np.square(away / self._cell)))
        self._field = fft.rfftn(field.reshape(size), self._shape)

    def best_of(self, rotations: Sequence[FloatArray]) -> list[tuple[float, FloatArray]]:
        """Return what `best` does of each of some rotations, sought side by side."""
        return list(in_order(lambda k: self.best(rotations[k]), len(rotations)))

    def best(self, rotation: FloatArray) -> tuple[float, FloatArray]:
        """Return the best score of any translation, and that placement as mannequin_from_surface, shape (4, 4)."""
        turned = self._points @ rotation.T
        index = np.floor(turned / self._cell).astype(int) + self._reach
        counts = np.zeros(self._shape)
        np.add.at(counts, tuple(index.T), 1.0)
        score = fft.irfftn(self._field * np.conj(fft.rfftn(counts)), self._shape)
        peak = np.unravel_index(int(np.argmax(score)), score.shape)
        shift = np.array([p - s if p > s // 2 else p for p, s in zip(peak, self._shape, strict=True)])
        placement = np.eye(4)
        placement[:3, :3] = rotation
        # Cell k of the turned scan, counted from -reach, falls on cell k + shift of the field.
        placement[:3, 3] = self._low + (shift + self._reach) * self._cell - rotation @ self._middle
        return float(score[peak]) / len(turned), placement
