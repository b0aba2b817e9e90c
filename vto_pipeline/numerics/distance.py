"""Where on a triangle is the point nearest to a given one."""

from __future__ import annotations

from numba import njit

from vto_pipeline.numerics.vector import axpy, dot, scale, sub

VERTEX, EDGE, FACE = 0, 3, 6
"""Features of a triangle: VERTEX + k, EDGE + k (from corner k to k+1), FACE."""


@njit(cache=True, error_model="numpy")
def closest_on_triangle(p, a, b, c):
    """Return barycentric weights (of a, b, c) of the point of triangle abc nearest to p, and the feature it lies on.

    Ericson 2005, "Real-Time Collision Detection", section 5.1.5. A zero-area triangle gives a point of its longest way.
    """
    ab, ac, ap = sub(b, a), sub(c, a), sub(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return (1.0, 0.0, 0.0), VERTEX
    bp = sub(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return (0.0, 1.0, 0.0), VERTEX + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return (1.0 - t, t, 0.0), EDGE
    cp = sub(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return (0.0, 0.0, 1.0), VERTEX + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return (1.0 - t, 0.0, t), EDGE + 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return (0.0, 1.0 - t, t), EDGE + 1
    v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    return (1.0 - v - w, v, w), FACE


@njit(cache=True, error_model="numpy")
def blend(weights, a, b, c):
    """Return the point with these barycentric weights."""
    return axpy(weights[0], a, axpy(weights[1], b, scale(weights[2], c)))
