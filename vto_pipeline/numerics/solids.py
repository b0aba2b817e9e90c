"""Signed distance to analytic solids, centred and axis-aligned: half-space, rounded box, ellipsoid.

Each gives the distance, negative inside, the nearest point of the surface, and the unit normal there. A box rounded by
r about half sizes h is a ball for h = 0, and a rod with round ends where only one of h is not zero. All three are
convex, so the distance is a convex function of the point: `first_touch` rests on that.
"""

from __future__ import annotations

from math import copysign, sqrt

from numba import njit

from vto_pipeline.numerics.vector import axpy, dot, norm, scale, sub

HALF_SPACE, ROUNDED_BOX, ELLIPSOID = 0, 1, 2
"""Kinds of solid; their sizes (4 numbers): none, half sizes and radius, semi-axes."""

_NEWTON = 100  # iterations at most: quadratic from where the sum is 3 at most
_POLE = 1e-14  # of the square of the shortest axis: nearer to its plane, the root is its pole
_GOLDEN = 0.6180339887498949
_SECTIONS = 40  # golden ones: 4e-9 of the way is left, and of distances the square of that
_HALVE = 50


@njit(cache=True, error_model="numpy")
def signed_distance(kind, size, p):
    """Return distance, point and normal of a solid of this kind and size (4 numbers) nearest to p."""
    if kind == HALF_SPACE:
        return p[1], (p[0], 0.0, p[2]), (0.0, 1.0, 0.0)
    if kind == ELLIPSOID:
        return _to_ellipsoid((size[0], size[1], size[2]), p)
    return _to_rounded_box((size[0], size[1], size[2]), size[3], p)


@njit(cache=True, error_model="numpy")
def first_touch(kind, size, p, move):
    """Return distance, point and normal for the place on the way from p, outside, to p + move that meets the solid.

    Where the way meets the solid, that is just before it enters; else where it is nearest. In both cases the plane
    through the point along the normal has the solid behind it and p before it: a vertex kept before the plane cannot
    come through, however thin the solid. Where the way misses the solid, all of it is before the plane, so the
    plane is no obstacle. The distance is that of p from the plane.
    """
    share = _nearest_share(kind, size, p, move)
    if _along(kind, size, p, move, share) <= 0.0:
        inside, share = share, 0.0
        for _ in range(_HALVE):
            middle = 0.5 * (share + inside)
            if _along(kind, size, p, move, middle) > 0.0:
                share = middle
            else:
                inside = middle
    _, point, normal = signed_distance(kind, size, axpy(share, move, p))
    return dot(normal, sub(p, point)), point, normal


@njit(cache=True, error_model="numpy")
def _nearest_share(kind, size, p, move):
    """Return the share of the way at which it is nearest to the solid, or one inside, by golden sections."""
    if _along(kind, size, p, move, 1.0) <= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    a, b = 1.0 - _GOLDEN, _GOLDEN
    at_a, at_b = _along(kind, size, p, move, a), _along(kind, size, p, move, b)
    for _ in range(_SECTIONS):
        if at_a <= 0.0:
            return a
        if at_b <= 0.0:
            return b
        if at_a < at_b:
            high, b, at_b = b, a, at_a
            a = high - _GOLDEN * (high - low)
            at_a = _along(kind, size, p, move, a)
        else:
            low, a, at_a = a, b, at_b
            b = low + _GOLDEN * (high - low)
            at_b = _along(kind, size, p, move, b)
    return high if high == 1.0 else low  # not the middle: at the end of the way, or its begin, this is exact


@njit(cache=True, error_model="numpy")
def _along(kind, size, p, move, share):
    return signed_distance(kind, size, axpy(share, move, p))[0]


@njit(cache=True, error_model="numpy")
def _to_rounded_box(half, radius, p):
    """Outside the box the nearest point is p cut to its sizes; inside, it is on the nearest face."""
    core = (
        min(half[0], max(-half[0], p[0])),
        min(half[1], max(-half[1], p[1])),
        min(half[2], max(-half[2], p[2])),
    )
    away = sub(p, core)
    length = norm(away)
    if length > 0.0:
        normal = scale(1.0 / length, away)
        return length - radius, axpy(radius, normal, core), normal
    dx, dy, dz = half[0] - abs(p[0]), half[1] - abs(p[1]), half[2] - abs(p[2])
    if dy <= dx and dy <= dz:  # of equals the upright one: cloth in the heart of a ball rises
        up = copysign(1.0, p[1])
        return -dy - radius, (p[0], up * (half[1] + radius), p[2]), (0.0, up, 0.0)
    if dx <= dz:
        side = copysign(1.0, p[0])
        return -dx - radius, (side * (half[0] + radius), p[1], p[2]), (side, 0.0, 0.0)
    front = copysign(1.0, p[2])
    return -dz - radius, (p[0], p[1], front * (half[2] + radius)), (0.0, 0.0, front)


@njit(cache=True, error_model="numpy")
def _to_ellipsoid(axes, p):
    """Eberly 2013, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid".

    The nearest point is a² p / (t + a²) per axis, with t the largest root of Σ (a p / (t + a²))² = 1. That sum falls
    and is convex, so Newton from the left of the root cannot overshoot. It runs on u = t + (shortest axis)².
    """
    ax, ay, az = axes
    px, py, pz = abs(p[0]), abs(p[1]), abs(p[2])
    least_sq = min(ax, ay, az) ** 2
    ex, ey, ez = ax * ax - least_sq, ay * ay - least_sq, az * az - least_sq
    u = max(ax * px - ex, ay * py - ey, az * pz - ez)  # one term alone is 1 there: left of the root
    if u <= _POLE * least_sq:
        if _left_over(axes, _above_the_middle(axes, p)) > 0.0:
            return _from_the_middle(axes, p)
        u = _POLE * least_sq
    for _ in range(_NEWTON):
        x, y, z = ax * px / (u + ex), ay * py / (u + ey), az * pz / (u + ez)
        excess = x * x + y * y + z * z - 1.0
        slope = 2.0 * (x * x / (u + ex) + y * y / (u + ey) + z * z / (u + ez))
        if excess <= 0.0 or u + excess / slope <= u:
            break
        u += excess / slope
    point = (
        copysign(ax * ax * px / (u + ex), p[0]),
        copysign(ay * ay * py / (u + ey), p[1]),
        copysign(az * az * pz / (u + ez), p[2]),
    )
    return _distance_to(axes, p, point)


@njit(cache=True, error_model="numpy")
def _above_the_middle(axes, p):
    """Return the nearest point without its part along the shortest axis, for t at the pole of that axis."""
    least = min(axes[0], axes[1], axes[2])
    return (
        0.0 if axes[0] == least else axes[0] * axes[0] * p[0] / (axes[0] * axes[0] - least * least),
        0.0 if axes[1] == least else axes[1] * axes[1] * p[1] / (axes[1] * axes[1] - least * least),
        0.0 if axes[2] == least else axes[2] * axes[2] * p[2] / (axes[2] * axes[2] - least * least),
    )


@njit(cache=True, error_model="numpy")
def _left_over(axes, point):
    return 1.0 - (point[0] / axes[0]) ** 2 - (point[1] / axes[1]) ** 2 - (point[2] / axes[2]) ** 2


@njit(cache=True, error_model="numpy")
def _from_the_middle(axes, p):
    """Return the answer for a point in the plane across the shortest axis whose nearest point is off that plane.

    t is then at the pole of that axis: the other two places are known, and the surface gives the third.
    """
    least = min(axes[0], axes[1], axes[2])
    x, y, z = _above_the_middle(axes, p)
    rise = least * sqrt(_left_over(axes, (x, y, z)))
    if axes[1] == least:
        y = copysign(rise, p[1])
    elif axes[0] == least:
        x = copysign(rise, p[0])
    else:
        z = copysign(rise, p[2])
    return _distance_to(axes, p, (x, y, z))


@njit(cache=True, error_model="numpy")
def _distance_to(axes, p, point):
    ax, ay, az = axes
    steep = (point[0] / (ax * ax), point[1] / (ay * ay), point[2] / (az * az))
    inside = (p[0] / ax) ** 2 + (p[1] / ay) ** 2 + (p[2] / az) ** 2 < 1.0
    length = norm(sub(p, point))
    return -length if inside else length, point, scale(1.0 / norm(steep), steep)
