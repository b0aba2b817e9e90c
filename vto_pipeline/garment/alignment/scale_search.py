"""Coarse placements of a scan whose scale is unknown: all translations, many turns, on a ladder of scales.

A share of the scan that lies on the mannequin says nothing about scale: it is largest for a scan that has shrunk to a
point of the surface. The area that it explains would be largest for one that is blown up and touches along a line. The
share times the scale is largest in between, where the shapes agree.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.garment.alignment.coarse_align import PlacementSearch, upright_rotations
from vto_pipeline.geometry.sampling import sample_surface
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

CELL, LARGEST_GRID = 0.045, 80
RANGE = (0.25, 8.0)
"""Scales that are tried, in ratios of the mannequin's median distance from its middle to the scan's."""
STEP = 0.08
"""Of the scale's logarithm: half a cell at the edge of a trunk."""
YAWS = 16
MANNEQUIN_SAMPLES = 4000


def scaled_starts(
    points: FloatArray, mannequin: TriangleMesh, distance: SurfaceDistance, least_share: float
) -> list[FloatArray]:
    """Return the placements of the scan that explain most of the mannequin, best first, each of another scale.

    Args:
        points: Of the scan, +Y up, in any unit, evenly spread by area, shape (N, 3).
        mannequin: In metres.
        distance: Its distance queries.
        least_share: Placements with a smaller share of the scan on the mannequin are left out: of a scan that is far
            too large, a few points touch it by chance, and stand for much area.

    Returns:
        mannequin_from_surface with its scale, each (4, 4); there may be none.
    """
    on_mannequin, _, _ = sample_surface(mannequin, MANNEQUIN_SAMPLES, seed=0)
    usual = _spread(on_mannequin) / _spread(points)
    found, turns = [], upright_rotations(YAWS)
    for scale in usual * np.exp(np.arange(np.log(RANGE[0]), np.log(RANGE[1]), STEP)):
        best = PlacementSearch(scale * points, mannequin, distance, CELL, LARGEST_GRID).best_of(turns)
        score, placement = max(best, key=lambda one: one[0])
        if score < least_share:
            continue
        found.append((score * scale, placement @ np.diag([scale, scale, scale, 1.0])))
    return [placement for _, placement in sorted(found, key=lambda one: -one[0])]


def _spread(points: FloatArray) -> float:
    """Return the median distance from the middle; a minority of stray points does not change it much."""
    return float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
