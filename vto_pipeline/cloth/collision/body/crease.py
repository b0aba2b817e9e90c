"""The other flank of a crease: a second contact of a vertex beside the nearest one.

In an armpit or under a chin the nearest place changes sides as cloth slides into the crease, and a vertex that is kept
from one flank at a time never comes to rest between the two. The flank it was nearest to last is remembered, and
followed while it is near.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.body.nearest import Nearest, SurfaceTree
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.distance import barycentric_point, closest_on_triangle
from vto_pipeline.numerics.vector import dot, load, norm, sub

_ALIKE = 0.9995  # cosine of the angle between flanks (2°) under which one plane says what two would
_LEFT = 0.25  # of the way from a point to a flank
_OPPOSED = -0.3  # cosine from which on they are walls of a gap: cloth is pinched between them, not held in a crease


def other_flank(
    surface: SurfaceTree, points: FloatArray, near: Nearest, last: tuple[IntArray, IntArray], reach: FloatArray
) -> Nearest:
    """Return the place of the other flank of a crease nearest to each point; triangle -1 where there is none.

    Args:
        surface: What can be touched.
        points: [m], shape (N, 3).
        near: The places nearest to them.
        last: Triangles it is looked for about, -1 for none, shapes (N,).
        reach: How far from a point it may be [m], shape (N,).
    """
    found = Nearest(np.full(len(points), -1, np.int32), np.zeros((len(points), 3)), np.zeros(len(points), np.int8))
    best = reach.copy()
    for triangles in last:
        asked = np.flatnonzero((triangles >= 0) & (triangles != near.triangle) & (near.triangle >= 0))
        if len(asked) == 0:
            continue
        # the point has gone on along the crease, and so does the place: what is near the old one is on its flank
        over = _shift_across(surface.vertices, surface.faces, points[asked], triangles[asked])
        there = surface.nearest(over, reach[asked], triangles[asked])
        _take_flanks(surface.vertices, surface.faces, points, near, asked, there.triangle, best, found)
    return found


@njit(cache=True)
def _shift_across(vertices, faces, points, triangles):  # type: ignore[no-untyped-def]
    """Return the points moved most of the way to these triangles [m], shape (N, 3)."""
    over = np.empty_like(points)
    for i in range(len(points)):
        t = triangles[i]
        a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
        weights, _ = closest_on_triangle(load(points, i), a, b, c)
        on = barycentric_point(weights, a, b, c)
        for d in range(3):
            over[i, d] = on[d] + _LEFT * (points[i, d] - on[d])
    return over


@njit(cache=True)
def _take_flanks(vertices, faces, points, near, asked, triangles, best, found):  # type: ignore[no-untyped-def]
    """Enter the places on these triangles in `found` that lie across a crease and are nearer than `best`."""
    for place in range(len(asked)):
        i, t = asked[place], triangles[place]
        if t < 0 or t == near.triangle[i]:
            continue
        p, n = load(points, i), near.triangle[i]
        on = barycentric_point(
            (near.weights[i, 0], near.weights[i, 1], near.weights[i, 2]),
            load(vertices, faces[n, 0]),
            load(vertices, faces[n, 1]),
            load(vertices, faces[n, 2]),
        )
        a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
        weights, feature = closest_on_triangle(p, a, b, c)
        there = barycentric_point(weights, a, b, c)
        away, away_there = sub(p, on), sub(p, there)
        distance, distance_there = norm(away), norm(away_there)
        if distance == 0.0 or distance_there == 0.0 or distance_there >= best[i]:
            continue
        angle = dot(away, away_there) / (distance * distance_there)
        hollow = dot(sub(there, on), away) > 0.0  # where it bulges, the other flank lies behind the plane of this one
        if hollow and _OPPOSED < angle < _ALIKE:
            best[i] = distance_there
            found.triangle[i], found.feature[i] = t, feature
            found.weights[i, 0], found.weights[i, 1], found.weights[i, 2] = weights
