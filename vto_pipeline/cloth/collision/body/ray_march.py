"""First hit of a moving point with a triangle surface.

Conservative advancement (Mirtich 1996): the surface is nowhere nearer than its distance, so a point may go that far at
once; it cannot step over the thinnest sheet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.nearest import Nearest, SurfaceTree
from vto_pipeline.model.arrays import FloatArray

_ARRIVED = 1e-5  # m: as near as this is touching
_RETURNS = 8  # between a way that passes by and the surface
_STEPS = 64  # at most; a way that grazes the surface so long is taken to touch where it came nearest


def march(surface: SurfaceTree, points: FloatArray, way: FloatArray, found: Nearest) -> tuple[FloatArray, Nearest]:
    """Return for each way its place nearest to the surface, or where it first touches it, and what is nearest there.

    Args:
        surface: What is in the way.
        points: Where the ways begin [m], shape (N, 3).
        way: From there [m], shape (N, 3).
        found: What is nearest to the begins; there is something.
    """
    length = np.linalg.norm(way, axis=1)
    place, best = points.copy(), found.subset(np.arange(len(points)))
    least, share = np.full(len(points), np.inf), np.zeros(len(points))
    going, there, now = np.arange(len(points)), points, found
    for _ in range(_STEPS):
        distance = np.linalg.norm(there - now.points_on(surface.vertices, surface.faces), axis=1)
        nearer = distance < least[going]
        chosen = going[nearer]
        least[chosen], place[chosen] = distance[nearer], there[nearer]
        best = best.with_replaced(chosen, now.subset(nearer))
        on = (distance > _ARRIVED) & (share[going] < 1.0)
        going = going[on]
        if len(going) == 0:
            break
        share[going] = np.minimum(1.0, share[going] + distance[on] / length[going])
        there = points[going] + share[going, None] * way[going]
        now = surface.nearest(there, np.full(len(going), np.inf), now.triangle[on])
    _minimise_distance(surface, points, way, place, best, np.flatnonzero((least > _ARRIVED) & (share >= 1.0)))
    return place, best


def _minimise_distance(
    surface: SurfaceTree,
    points: FloatArray,
    way: FloatArray,
    place: FloatArray,
    best: Nearest,
    passing: NDArray[np.int64],
) -> None:
    """Go from place on the way to the surface and back until the two are as near as they come, in place.

    Alternating projections (Cheney & Goldstein 1959). At the end the plane that faces the place has all of the way
    before it.
    """
    start, along = points[passing], way[passing]
    length_sq = np.einsum("ij,ij->i", along, along)
    for _ in range(_RETURNS):
        now = best.subset(passing)
        share = np.einsum("ij,ij->i", now.points_on(surface.vertices, surface.faces) - start, along) / length_sq
        place[passing] = start + np.clip(share, 0.0, 1.0)[:, None] * along
        now = surface.nearest(place[passing], np.full(len(passing), np.inf), now.triangle)
        best.triangle[passing], best.weights[passing], best.feature[passing] = now
