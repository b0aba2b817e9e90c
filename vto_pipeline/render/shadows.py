"""Soft shadows: what a light does not see lies in its shadow (shadow maps; Williams 1978).

Each place is compared with all of the map about it within the light's breadth (percentage closer filtering; Reeves,
Salesin & Cook 1987), so that edges are soft, and no stairs show.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.rasterise import rasterise

_MAP = 1024  # texels a side
_ASIDE = 3  # texels to each side that are compared, twice the distance of a pixel's neighbours
_CLEAR, _STEEP = 1.5, 24.0  # texels: how far behind what the light sees a place is lit all the same, and most of it


class ShadowMap:
    """What a distant light sees.

    Args:
        corners: Of the triangles that cast shadows, shape (F, 3, 3).
        towards: Where the light comes from, a unit vector, shape (3,).
    """

    def __init__(self, corners: FloatArray, towards: FloatArray) -> None:
        right = np.cross([0.0, 1.0, 0.0], towards)
        right /= np.linalg.norm(right)
        self._towards = towards
        self._axes = np.stack([right, np.cross(towards, right), -towards])  # depth grows away from the light
        seen = corners @ self._axes.T
        low, high = seen.reshape(-1, 3).min(axis=0), seen.reshape(-1, 3).max(axis=0)
        self._texels = (_MAP - 2 * _ASIDE - 1) / max(float((high - low)[:2].max()), 1e-9)  # per metre
        self._shift = low - _ASIDE / self._texels
        self._depth = rasterise((seen - self._shift) * self._texels, _MAP, _MAP)[2]

    def lit(self, places: FloatArray, normals: FloatArray) -> FloatArray:
        """Return how much of the light each place sees, 0 to 1, shape (N,).

        Args:
            places, normals: In the frame of the triangles, shape (N, 3); normals of any length and sign.
        """
        across = np.abs(normals @ self._towards) / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
        slope = np.sqrt(1.0 - np.minimum(across, 1.0) ** 2) / np.maximum(across, 1e-6)
        clear = np.minimum(_CLEAR + (_ASIDE + 0.5) * slope, _STEEP)  # so a tilted surface does not shade itself
        shares: FloatArray = _lit((places @ self._axes.T - self._shift) * self._texels, clear, self._depth)
        return shares


@njit(cache=True, error_model="numpy", parallel=True)
def _lit(places, clear, depth):  # type: ignore[no-untyped-def]  # typed by Numba
    shares = np.empty(len(places))
    for n in prange(len(places)):
        column, row = int(np.round(places[n, 0])), int(np.round(places[n, 1]))
        seen = 0
        for i in range(row - _ASIDE, row + _ASIDE + 1):
            for j in range(column - _ASIDE, column + _ASIDE + 1):
                inside = 0 <= i < len(depth) and 0 <= j < depth.shape[1]
                if not inside or places[n, 2] - clear[n] <= depth[i, j]:
                    seen += 1
        shares[n] = seen / (2 * _ASIDE + 1) ** 2
    return shares
