"""Nearest points: of a triangle to a point, and of two segments to each other."""

from __future__ import annotations

from numba import njit

from vto_pipeline.numerics.vector import axpy, cross, dot, scale, sub

VERTEX, EDGE, FACE = 0, 3, 6
"""Features of a triangle: VERTEX + k, EDGE + k (from corner k to k+1), FACE."""


_SLIVER_SQ = 1e-12  # of (height / longest edge)²: flatter, the rim may be nearer than what is found inside


@njit(cache=True, error_model="numpy")
def closest_on_triangle(p, a, b, c):
    """Return barycentric weights (of a, b, c) of the point of triangle abc nearest to p, and the feature it lies on.

    By the side of p on which each edge is (Ericson 2005, "Real-Time Collision Detection", section 3.4), from cross
    products: inner ones lose a triangle that is flatter than the root of rounding. The distance is right to rounding
    times length / height, and where that is more than 1e-8 of the size (slivers, lines, points) to 1e-8.
    """
    ab, bc, ca = sub(b, a), sub(c, b), sub(a, c)
    ap, bp, cp = sub(p, a), sub(p, b), sub(p, c)
    normal = cross(ab, bc)
    to_a, to_b, to_c = dot(normal, cross(bc, bp)), dot(normal, cross(ca, cp)), dot(normal, cross(ab, ap))
    inside = to_a > 0.0 and to_b > 0.0 and to_c > 0.0
    v, w = to_b / (to_a + to_b + to_c), to_c / (to_a + to_b + to_c)
    longest_sq = max(dot(ab, ab), dot(bc, bc), dot(ca, ca))
    if inside and dot(normal, normal) > _SLIVER_SQ * longest_sq * longest_sq:
        return (1.0 - v - w, v, w), FACE
    s = _nearest_share(ap, ab)
    best, feature, best_sq = (1.0 - s, s, 0.0), _on_edge(s, 0), _distance_sq(ap, s, ab)
    s = _nearest_share(bp, bc)
    apart_sq = _distance_sq(bp, s, bc)
    if apart_sq < best_sq:
        best, feature, best_sq = (0.0, 1.0 - s, s), _on_edge(s, 1), apart_sq
    s = _nearest_share(cp, ca)
    apart_sq = _distance_sq(cp, s, ca)
    if apart_sq < best_sq:
        best, feature, best_sq = (s, 0.0, 1.0 - s), _on_edge(s, 2), apart_sq
    if inside:
        away = axpy(-v, ab, axpy(w, ca, ap))
        if dot(away, away) < best_sq:
            return (1.0 - v - w, v, w), FACE
    return best, feature


@njit(cache=True, error_model="numpy")
def _on_edge(s, k):
    """Return the feature at share s of the edge from corner k to the next."""
    if s == 0.0:
        return VERTEX + k
    if s == 1.0:
        return VERTEX + (k + 1) % 3
    return EDGE + k


@njit(cache=True, error_model="numpy")
def _distance_sq(x, s, u):
    away = axpy(-s, u, x)
    return dot(away, away)


@njit(cache=True, error_model="numpy")
def closest_on_segments(a, b, c, d):
    """Return the shares (s, t) of the nearest points a + s (b - a) and c + t (d - c) of two segments.

    The nearest of: the end points against the other segment, and the common perpendicular (Goldman 1990, "Intersection
    of two lines in three-space", Graphics Gems), its shares projected once more, so that segments that are nearly
    parallel lose nothing. Where segments run parallel, or have no length, many are nearest and one is returned.
    """
    u, v, w = sub(b, a), sub(d, c), sub(c, a)
    best = 0.0, _nearest_share(sub(a, c), v)
    best_sq = _apart_sq(u, v, w, best)
    for shares in (
        (1.0, _nearest_share(sub(b, c), v)),
        (_nearest_share(w, u), 0.0),
        (_nearest_share(sub(d, a), u), 1.0),
    ):
        apart_sq = _apart_sq(u, v, w, shares)
        if apart_sq < best_sq:
            best, best_sq = shares, apart_sq
    normal = cross(u, v)
    normal_sq = dot(normal, normal)
    if normal_sq > 0.0:
        s = min(max(dot(cross(w, v), normal) / normal_sq, 0.0), 1.0)
        t = _nearest_share(axpy(s, u, scale(-1.0, w)), v)
        shares = _nearest_share(axpy(t, v, w), u), t
        if _apart_sq(u, v, w, shares) < best_sq:
            best = shares
    return best


@njit(cache=True, error_model="numpy")
def _nearest_share(x, u):
    """Return s in [0, 1] with s u nearest to x."""
    along, length_sq = dot(x, u), dot(u, u)
    if not along > 0.0:
        return 0.0
    return along / length_sq if along < length_sq else 1.0


@njit(cache=True, error_model="numpy")
def _apart_sq(u, v, w, shares):
    between = sub(axpy(shares[1], v, w), scale(shares[0], u))
    return dot(between, between)


@njit(cache=True, error_model="numpy")
def barycentric_point(weights, a, b, c):
    """Return the point with these barycentric weights."""
    return axpy(weights[0], a, axpy(weights[1], b, scale(weights[2], c)))
