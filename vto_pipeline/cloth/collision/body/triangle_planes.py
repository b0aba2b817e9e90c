"""Contact planes attached to moving triangles."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.numerics.distance import barycentric_point
from vto_pipeline.numerics.spatial.pseudonormals import feature_normal
from vto_pipeline.numerics.vector import cross, dot, load, norm, scale, store, sub, unit

INSIDE, RIM, OUTSIDE, NOWHERE = -1, 0, 1, 2
"""Where a point is: inside, nearest to the rim of an open surface, outside, or near nothing."""

_ROUNDING = 1e-7  # m: nearer to the surface, the direction to it is only rounding


@njit(cache=True)
def sides(vertices, faces, normals, points, triangle, weights, feature):  # type: ignore[no-untyped-def]
    """Return on which side of its nearest triangle (-1: none) each point is, shape (N,), and how far away [m]."""
    side = np.empty(len(points), np.int8)
    distance = np.full(len(points), np.inf)
    for i in range(len(points)):
        t = triangle[i]
        if t < 0:
            side[i] = NOWHERE
            continue
        a, b, c = load(vertices, faces[t, 0]), load(vertices, faces[t, 1]), load(vertices, faces[t, 2])
        away = sub(load(points, i), barycentric_point((weights[i, 0], weights[i, 1], weights[i, 2]), a, b, c))
        distance[i] = norm(away)
        out = feature_normal(normals, faces, t, feature[i])
        if out == (0.0, 0.0, 0.0):
            side[i] = RIM
        else:
            side[i] = OUTSIDE if dot(away, out) >= 0.0 else INSIDE
    return side, distance


@njit(cache=True)
def triangle_planes(before, after, faces, normals, positions, seen_from, side, triangle, weights, feature):  # type: ignore[no-untyped-def]
    """Return the planes of a contact span.

    Args:
        before, after: The surface at start and end [m], shape (N, 3).
        faces, normals: Its triangles and their pseudonormals at the start.
        positions: Of the cloth [m], shape (V, 3).
        seen_from: The place that each plane faces, straight before its point [m], shape (V, 3).
        side: As from `sides`; on a rim as outside.
        triangle, weights, feature: The place nearest to that on the surface.

    Returns:
        Distance of the vertices from their planes (V,), negative inside; point and normal at start and end (V, 2, 3);
        whether there is a plane (V,).
    """
    count = len(positions)
    distance = np.full(count, np.inf)
    point, normal = np.zeros((count, 2, 3)), np.zeros((count, 2, 3))
    near = np.zeros(count, np.bool_)
    for i in range(count):
        t = triangle[i]
        if t < 0:
            continue
        a, b, c = load(before, faces[t, 0]), load(before, faces[t, 1]), load(before, faces[t, 2])
        w = (weights[i, 0], weights[i, 1], weights[i, 2])
        on = barycentric_point(w, a, b, c)
        away = sub(load(seen_from, i), on)
        length = norm(away)
        if length > _ROUNDING:
            n = scale((-1.0 if side[i] == INSIDE else 1.0) / length, away)
        else:
            n = unit(feature_normal(normals, faces, t, feature[i]))
            if n == (0.0, 0.0, 0.0):
                continue
        a1, b1, c1 = load(after, faces[t, 0]), load(after, faces[t, 1]), load(after, faces[t, 2])
        near[i] = True
        distance[i] = dot(n, sub(load(positions, i), on))
        store(point[i], 0, on)
        store(point[i], 1, barycentric_point(w, a1, b1, c1))
        store(normal[i], 0, n)
        store(normal[i], 1, _turned(n, a, b, c, a1, b1, c1))
    return distance, point, normal, near


@njit(cache=True)
def _turned(n, a, b, c, a1, b1, c1):  # type: ignore[no-untyped-def]
    """Return direction n after triangle abc has moved to a1 b1 c1, turning with its edge ab and its normal."""
    u, z = unit(sub(b, a)), unit(cross(sub(b, a), sub(c, a)))
    u1, z1 = unit(sub(b1, a1)), unit(cross(sub(b1, a1), sub(c1, a1)))
    v, v1 = cross(z, u), cross(z1, u1)
    x, y, w = dot(n, u), dot(n, v), dot(n, z)
    turned = (
        x * u1[0] + y * v1[0] + w * z1[0],
        x * u1[1] + y * v1[1] + w * z1[1],
        x * u1[2] + y * v1[2] + w * z1[2],
    )
    return unit(turned) if norm(turned) > 0.5 else n
