"""The floor under a scan: where most of its level surface lies, and nothing much below."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vto_pipeline.geometry.topology import face_area_vectors
from vto_pipeline.model.mesh import TriangleMesh

_LEVEL = 0.98
"""Cosine between the vertical and the normal of what counts as level."""
_BAND_M = 0.008


class LevelBand(NamedTuple):
    """The height at which a surface has most of its level part.

    Args:
        area: Of the level part within the band [m²].
        share: Of the band's whole area that it is.
        beneath: Area of the surface under the band [m²].
        height: Of the level part, the median by area [m].
        top: Upper end of the band [m].
    """

    area: float
    share: float
    beneath: float
    height: float
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
    level = (np.abs(area[:, 1]) > _LEVEL * size) & (middle < below)
    if not level.any():
        return None
    bottom = float(scan.vertices[:, 1].min())
    band = np.floor((middle - bottom) / _BAND_M).astype(int)
    spread = np.convolve(np.bincount(band[level], size[level]), np.ones(3), mode="same")
    best = int(np.argmax(spread))
    near, under = np.abs(band - best) <= 1, band < best - 1
    heights, sizes = middle[near & level], size[near & level]
    order = np.argsort(heights)
    half = np.searchsorted(np.cumsum(sizes[order]), 0.5 * sizes.sum())
    return LevelBand(
        area=float(spread[best]),
        share=float(sizes.sum() / size[near].sum()),
        beneath=float(size[under].sum()),
        height=float(heights[order[half]]),
        top=bottom + (best + 2) * _BAND_M,
    )


def floor_height(scan: TriangleMesh, below: float) -> float | None:
    """Return the height of the floor [m]: level surface for the most part, and less of the scan beneath it than in it.

    Cloth and stands are steep where they end, so that the level surface of a hem or a frill is no floor.

    Args:
        scan: In metres, +Y up.
        below: Height that the floor is not above [m].
    """
    found = level_band(scan, below)
    if found is None or found.share < 0.5 or found.beneath > found.area:
        return None
    return found.height
