"""How wide panels are: across at a level, and over all panels."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vto_pipeline.garment.sizes.outline import Outline
from vto_pipeline.io.patterns.loops import edges_length
from vto_pipeline.model.arrays import FloatArray


def width_at(points: FloatArray, level: float) -> float:
    """Return how much of a level line lies inside a polygon [m].

    Args:
        points: Corners of the polygon, across and up [m], shape (N, 2).
        level: Height of the line [m]; the polygon is taken just below it, where a corner lies on it.
    """
    ends = np.roll(points, -1, axis=0)
    crossing = (points[:, 1] >= level) != (ends[:, 1] >= level)
    a, b = points[crossing], ends[crossing]
    at = np.sort(a[:, 0] + (level - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0]))
    return float((at[1::2] - at[::2]).sum())


def edge_lengths(panels: Iterable[Outline], role: str) -> float:
    """Return the length of all edges of one name [m]."""
    return sum(edges_length([one.panel.edges[k]]) for one in panels for k in one.edges_of(role))


def armpit_level(one: Outline) -> float | None:
    """Return the height of the lowest corner between armhole and side [m]; None: the panel has none."""
    corners = one.corners_between("armhole", "side")
    return float(one.corners[corners, 1].min()) if corners else None


def crotch_level(one: Outline) -> float:
    """Return the height of the corner between crotch seam and inseam of a leg [m]."""
    return float(one.corners[one.corners_between("crotch", "inseam"), 1].min())


def middle_level(one: Outline, role: str) -> float | None:
    """Return the mean height of the ends of all edges of one name [m]; None: the panel has none."""
    ends = [one.corners[j % len(one.corners), 1] for k in one.edges_of(role) for j in (k, k + 1)]
    return float(np.mean(ends)) if ends else None
