"""Ease at every height of the trunk, carried to the garment's vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.assess.zones import ease_at_levels
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_STEP = 0.02  # between levels [m]


def ease_map(
    garment: TriangleMesh,
    rest: FloatArray,
    body: TriangleMesh,
    garment_faces: NDArray[np.bool_],
    body_faces: NDArray[np.bool_],
) -> FloatArray:
    """Return how much longer a tape about the garment is than one about the body, at each vertex's height.

    Args:
        garment, rest, body: As in `ease_at`.
        garment_faces, body_faces: Which faces are trunk, shape (F,) and (B,).

    Returns:
        [m], shape (V,); NaN on sleeves and legs, and where the garment does not go around the body.
    """
    found = np.full(len(garment.vertices), np.nan)
    on_trunk = np.zeros(len(garment.vertices), np.bool_)
    on_trunk[garment.faces[garment_faces]] = True
    heights = garment.vertices[on_trunk, 1]
    if not len(heights):
        return found
    count = max(2, int(np.ptp(heights) / _STEP) + 1)
    # half a step from the borders, where a level would only graze them
    levels = np.linspace(heights.min(), heights.max(), 2 * count + 1)[1::2]
    measured = ease_at_levels(garment, rest, body, {str(y): y for y in levels}, garment_faces, body_faces)
    eases = np.array([np.nan if ease is None else ease.ease for ease in measured.values()])
    nearest = np.clip(np.searchsorted(0.5 * (levels[1:] + levels[:-1]), heights), 0, len(levels) - 1)
    smooth = np.interp(heights, levels, eases)  # NaN beside a level without ease
    found[on_trunk] = np.where(np.isnan(smooth), eases[nearest], smooth)
    return found
