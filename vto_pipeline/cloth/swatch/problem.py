"""The least squares of strips: unknowns, distances from points to elasticas, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.spatial import cKDTree

from vto_pipeline.cloth.swatch.elastica import FLATTEST, STEEPEST, gamma_of_angle, hanging, path
from vto_pipeline.cloth.swatch.noise import Noise, explain
from vto_pipeline.cloth.swatch.strip import Strip
from vto_pipeline.model.arrays import FloatArray

LOG_RIGIDITY, CURL, _SHARED = 0, 1, 2
"""Places among the unknowns; then for each strip across and up of its edge, log of its overhang, angle of its edge."""

_POINTS = 120  # of a strip; of more, neighbours are averaged
_FIRST_NOISE = 0.5e-3  # [m]
_TIP = 0.5e-3  # standard deviation of where a strip ends [m]
_TILT = np.radians(0.5)  # of an edge that is called level [rad]
_CURL = 20.0  # of the curl [1/m]: a radius of 50 mm without load is strong
_STEP = 1e-4  # of derivatives
_WIDEST = 12.0  # of log B and of the other unknowns


class Problem:
    """Strips of one fabric. All unknowns are in units of `unit`, the mean length of the profiles.

    Args:
        strips: Laid right.
        unit: [m]; None: the mean length.
        curl: Mean and standard deviation of the curl beforehand, in units of 1 / `unit`; None: zero and any curl.
    """

    def __init__(
        self, strips: Sequence[Strip], unit: float | None = None, curl: tuple[float, float] | None = None
    ) -> None:
        self.strips = strips
        coarse = [strip.thinned(15) for strip in strips]
        self.unit = unit or float(np.mean([_length(line) for line in coarse]))
        self._coarse = [line / self.unit for line in coarse]
        self._lines = [strip.thinned(_POINTS) / self.unit for strip in strips]
        self._tips = [strip.points[-1] / self.unit for strip in strips]
        self._curl = curl or (0.0, _CURL * self.unit)
        self.points = sum(map(len, self._lines))

    def per_strip(self, unknown: FloatArray) -> FloatArray:
        """Return what belongs to each strip: across, up, log of the overhang, angle of the edge; shape (S, 4)."""
        return unknown[_SHARED:].reshape(-1, 4)

    def starts(self) -> Iterator[FloatArray]:
        """Yield unknowns to start from, with the edge at several places along the strips."""
        for share in (0.0, 0.15, 0.3, 0.45, 0.6):
            own, logs = [], []
            for line in self._coarse:
                rest = line[int(share * len(line)) :]
                across, up = rest[-1] - rest[0]
                chord = np.clip(np.arctan2(-up, across), 1.2 * FLATTEST, 0.97 * STEEPEST)
                long = _length(rest)
                logs.append(3.0 * np.log(long) - np.log(gamma_of_angle(float(chord))))
                own.append([*rest[0], np.log(long), 0.0])
            yield np.concatenate([[np.mean(logs), self._curl[0]], np.ravel(own)])

    def solve(self, start: FloatArray, whitening: FloatArray | None = None, most: int | None = None) -> OptimizeResult:
        """Return the fit from a start in at most so many steps, with noise that neighbours do not share by default."""
        white = np.eye(self.points) * (self.unit / _FIRST_NOISE) if whitening is None else whitening

        def residuals(unknown: FloatArray) -> FloatArray:
            distances, known = self._parts(unknown)
            return np.concatenate([white @ distances, known])

        def slopes(unknown: FloatArray) -> FloatArray:
            distances, known = self._slopes(unknown)
            return np.concatenate([white @ distances, known])

        low, high = start - _WIDEST, start + _WIDEST
        return least_squares(residuals, start, slopes, (low, high), x_scale="jac", xtol=1e-6, ftol=1e-6, max_nfev=most)

    def noise(self, unknown: FloatArray) -> Noise:
        """Return what the distances that are left say about the noise."""
        distances, known = self._slopes(unknown)
        places = [np.linspace(0.0, 1.0, len(line)) for line in self._lines]
        return explain(self.distances(unknown), distances, known.T @ known, places)

    def distances(self, unknown: FloatArray) -> FloatArray:
        """Return the distance of each point to its strip's elastica, continued straight; positive above; shape (N,)."""
        return self._parts(unknown)[0]

    def _parts(self, unknown: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the distances, and the curl, edges and tips in standard errors from what is known of them."""
        parts = [self._one(index, self._own(unknown, index)) for index in range(len(self.strips))]
        curl = [(unknown[CURL] - self._curl[0]) / self._curl[1]]
        return np.concatenate([part[:-2] for part in parts]), np.concatenate([curl, *(part[-2:] for part in parts)])

    def _slopes(self, unknown: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of both by the unknowns."""
        rows, known = [], [np.eye(1, len(unknown), CURL) / self._curl[1]]
        for index in range(len(self.strips)):
            own = self._own(unknown, index)
            columns = [
                (self._one(index, own + step) - self._one(index, own - step)) / (2.0 * _STEP)
                for step in _STEP * np.eye(len(own))
            ]
            all_columns = np.zeros((len(columns[0]), len(unknown)))
            at = _SHARED + 4 * index
            all_columns[:, [LOG_RIGIDITY, CURL, *range(at, at + 4)]] = np.column_stack(columns)
            rows.append(all_columns[:-2])
            known.append(all_columns[-2:])
        return np.concatenate(rows), np.concatenate(known)

    def _own(self, unknown: FloatArray, index: int) -> FloatArray:
        return np.concatenate([unknown[:_SHARED], self.per_strip(unknown)[index]])

    def _one(self, index: int, own: FloatArray) -> FloatArray:
        """Return the distances of one strip, then how far its edge is from level and its tip from the last point."""
        log_rigidity, curl, across, up, log_overhang, edge = own
        overhang = float(np.exp(log_overhang))
        gamma = float(np.exp(3.0 * log_overhang - log_rigidity))
        theta = hanging(gamma, float(self.strips[index].face * curl * overhang), float(edge))
        curve = overhang * path(theta) + (across, up)
        nearest = cKDTree(curve).query(self._lines[index])[1]
        away, angle = self._lines[index] - curve[nearest], theta[nearest]
        ahead = away[:, 0] * np.cos(angle) - away[:, 1] * np.sin(angle)
        above = away[:, 0] * np.sin(angle) + away[:, 1] * np.cos(angle)
        bend = np.gradient(theta, overhang / (len(theta) - 1))[nearest]
        beyond = ((nearest == 0) & (ahead < 0.0)) | ((nearest == len(theta) - 1) & (ahead > 0.0))
        distances = above + np.where(beyond, 0.0, 0.5 * bend * ahead**2)
        past = (self._tips[index] - curve[-1]) @ (np.cos(theta[-1]), -np.sin(theta[-1]))
        return np.append(distances, [edge / _TILT, past * self.unit / _TIP])


def _length(line: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
