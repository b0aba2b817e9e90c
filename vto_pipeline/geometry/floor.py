"""The floor under a scan: where most of its level surface lies, and nothing much below."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import face_area_vectors
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_LEVEL = 0.98
"""Cosine between the vertical and the normal of what counts as level."""
_BAND_M = 0.008
_AROUND_M = 0.03
"""Normals are averaged over cubes of this side: the noise of a depth camera tilts every triangle of a fine mesh."""


class LevelBand(NamedTuple):
    """The height at which a surface has most of its level part.

    Args:
        area: Of the level part within the band [m²].
        share: Of the band's whole area that it is.
        beneath: Area of the surface under the band [m²].
        height: Of the level part, the median by area [m].
        noise: Standard deviation of its vertices' height, from the median of what they are off [m].
        top: Upper end of the band [m].
    """

    area: float
    share: float
    beneath: float
    height: float
    noise: float
    top: float


def level_band(scan: TriangleMesh, below: float) -> LevelBand | None:
    """Return where the scan has most level surface under a height; None where it has none there.

    Args:
        scan: In metres, +Y up.
        below: Height [m].
    """
    area = face_area_vectors(scan)
    size = np.linalg.norm(area, axis=1)
    middle = scan.vertices[scan.faces].mean(axis=1)[:, 1]
    low = np.flatnonzero(middle < below)
    level = np.zeros(len(middle), dtype=bool)
    level[low] = _level(scan.vertices[scan.faces[low]].mean(axis=1), area[low])
    if not level.any():
        return None
    bottom = float(scan.vertices[:, 1].min())
    band = np.maximum(np.floor((middle - bottom) / _BAND_M), 0).astype(int)  # a mean may round to below all three
    spread = np.convolve(np.bincount(band[level], size[level]), np.ones(3), mode="same")
    best = int(np.argmax(spread))
    near, under = np.abs(band - best) <= 1, band < best - 1
    heights, sizes = middle[near & level], size[near & level]
    height = _median(heights, sizes)
    points = scan.vertices[np.unique(scan.faces[near & level]), 1]
    return LevelBand(
        area=float(spread[best]),
        share=float(sizes.sum() / size[near].sum()),
        beneath=float(size[under].sum()),
        height=height,
        noise=float(np.median(np.abs(points - height))) / 0.6745,
        top=bottom + (best + 2) * _BAND_M,
    )


def _level(middle: FloatArray, area: FloatArray) -> NDArray[np.bool_]:
    """Return which faces lie in surface that is level over some centimetres, shape (F,).

    Args:
        middle: Of the faces [m], shape (F, 3).
        area: Their area vectors [m²], shape (F, 3). Upper and lower sides are averaged apart.
    """
    cube = np.column_stack([np.floor(middle / _AROUND_M).astype(np.int64), area[:, 1] > 0.0])
    of_cube = np.unique(cube, axis=0, return_inverse=True)[1].reshape(-1)
    total = np.column_stack([np.bincount(of_cube, axis) for axis in area.T])
    level = np.abs(total[:, 1]) > _LEVEL * np.linalg.norm(total, axis=1)
    return np.asarray(level[of_cube])


def _median(values: FloatArray, weights: FloatArray) -> float:
    """Return the median of values, shape (N,), by weight, shape (N,)."""
    order = np.argsort(values)
    return float(values[order[np.searchsorted(np.cumsum(weights[order]), 0.5 * weights.sum())]])


def find_floor(scan: TriangleMesh, below: float) -> LevelBand | None:
    """Return the floor: level surface for the most part, and less of the scan beneath it than in it.

    Cloth and stands are steep where they end, so that the level surface of a hem or a frill is no floor.

    Args:
        scan: In metres, +Y up.
        below: Height that the floor is not above [m].
    """
    found = level_band(scan, below)
    if found is None or found.share < 0.5 or found.beneath > found.area:
        return None
    return found
