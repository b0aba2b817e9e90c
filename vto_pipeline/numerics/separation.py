"""Time until which a plane separates the origin from a moving triangle or parallelogram.

The figure has corner x and sides u and v, each moving in a straight line over the time [0, 1]; the parallelogram has a
fourth corner x + u + v. Two planes are tried, and both stay true for a stretch of time that is found in closed form:

* a **fixed** direction n, |n| = 1: along it each corner has the height n·x(t), linear in t, and the figure is no nearer
  than its lowest corner;
* the figure's own plane, which **turns** with it: (u × v)·x is a cubic of t whose Bernstein coefficients bound it
  (Provot 1997 for the cubic; Sederberg & Nishita 1990, "Curve intersection using Bézier clipping").

Times are never late: all rounding is covered by the margins, which are bounds of the sum of all rounding errors made,
with u = 2^-53 and every component of x, u and v at most `size`:

* height: inputs u, product and sums 3u, corner 2u, and |n| to 3u, of at most 5.2 size, together 47u size; blending the
  two ends 3u of 5.2 size; the time itself, rounded by 2u, shifts a height by at most 10.4 size as much: 21u. 128u size.
* cubic: 6 triple products of at most |u||v||x| (largest components), each with 16u for its factors, products and sums;
  blossoming 9u and the time 12u of their sum: 222u |u||v||x|. 256u, and a little for what underflows.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from vto_pipeline.numerics.vector import add, axpy, cross, dot, norm, scale, sub

HEIGHT_MARGIN = 2.0**-46
"""Of the largest component of any corner or side: below it a height may be rounding."""
CUBIC_MARGIN = 2.0**-45
UNDERFLOW = 1e-290  # above all that underflow can lose, below what counts, for figures of size 2^-100 to 2^100
_RESOLUTION = 2.0**-50  # a shorter time is no progress
_CLIPS = 64  # of a cubic; each about squares the error, save where roots meet


@njit(cache=True, error_model="numpy", forceinline=True)
def lerp(a, b, t):
    """Return (1 - t) a + t b, exact at both ends."""
    r = 1.0 - t
    return r * a[0] + t * b[0], r * a[1] + t * b[1], r * a[2] + t * b[2]


@njit(cache=True, error_model="numpy")
def vector_to_rim(x, u, v, four):
    """Return the vector from the origin to the nearest point of the figure's rim.

    Which edge that is decides only how long the plane across the vector holds, never whether it may be trusted.
    """
    best = _to_segment(x, u)
    best_sq = dot(best, best)
    y = _to_segment(x, v)
    y_sq = dot(y, y)
    if y_sq < best_sq:
        best, best_sq = y, y_sq
    y = _to_segment(add(x, u), v if four else sub(v, u))
    y_sq = dot(y, y)
    if y_sq < best_sq:
        best, best_sq = y, y_sq
    if four:
        y = _to_segment(add(x, v), u)
        if dot(y, y) < best_sq:
            best = y
    return best


@njit(cache=True, error_model="numpy")
def _to_segment(x, u):
    """Return the point of the segment from x to x + u nearest to the origin."""
    along, length_sq = -dot(x, u), dot(u, u)
    if not along > 0.0:
        return x
    if along >= length_sq:
        return add(x, u)
    y = axpy(along / length_sq, u, x)
    return axpy(-dot(y, u) / length_sq, u, y)  # once more: the first leaves a part along u of |x| rounding, not |y|


@njit(cache=True, error_model="numpy")
def lowest_height(n, x, u, v, four):
    """Return the height along n of the lowest corner."""
    first, second = dot(n, u), dot(n, v)
    if four:
        return dot(n, x) + min(first, 0.0) + min(second, 0.0)
    return dot(n, x) + min(first, second, 0.0)


@njit(cache=True, error_model="numpy")
def fixed_until(n, low, t, x0, u0, v0, x1, u1, v1, four):
    """Return until when after t every corner stays above `low` along n; inf: through time 1.

    Args:
        n: Unit vector.
        low: Height, margin included.
        t: From when; t itself when not even then.
        x0, u0, v0: The figure at time 0.
        x1, u1, v1: And at 1.
        four: Whether it has the fourth corner.
    """
    a0, b0, c0 = dot(n, x0), dot(n, u0), dot(n, v0)
    a1, b1, c1 = dot(n, x1), dot(n, u1), dot(n, v1)
    until = min(
        _line_until(a0, a1, low, t), _line_until(a0 + b0, a1 + b1, low, t), _line_until(a0 + c0, a1 + c1, low, t)
    )
    if four:
        until = min(until, _line_until(a0 + b0 + c0, a1 + b1 + c1, low, t))
    return until


@njit(cache=True, error_model="numpy")
def _line_until(a, b, low, t):
    now = (1.0 - t) * a + t * b
    if not now > low:
        return t
    if b > low:
        return np.inf
    return t + (1.0 - t) * ((now - low) / (now - b))


@njit(cache=True, error_model="numpy")
def plane_cubic(x0, u0, v0, x1, u1, v1):
    """Return the Bernstein coefficients of (u × v)·x, and those of a bound of |u × v|, over the time [0, 1]."""
    n0, n2 = cross(u0, v0), cross(u1, v1)
    n1 = scale(0.5, add(cross(u0, v1), cross(u1, v0)))
    height = dot(n0, x0), (2.0 * dot(n1, x0) + dot(n0, x1)) / 3.0, (2.0 * dot(n1, x1) + dot(n2, x0)) / 3.0, dot(n2, x1)
    first, middle, last = norm(n0), norm(n1), norm(n2)
    area = first, (first + 2.0 * middle) / 3.0, (2.0 * middle + last) / 3.0, last
    return height, area


@njit(cache=True, error_model="numpy")
def plane_until(height, area, low, margin, t):
    """Return until when after t the origin stays further than `low` from the figure's turning plane; inf: through 1.

    Args:
        height, area: From `plane_cubic`.
        low: Distance.
        margin: Of the cubic's rounding.
        t: From when; t itself when not even then.
    """
    side = math.copysign(1.0, _restrict(height, t, t)[0])
    h0, h1 = side * height[0] - low * area[0] - margin, side * height[1] - low * area[1] - margin
    h2, h3 = side * height[2] - low * area[2] - margin, side * height[3] - low * area[3] - margin
    step = 1.0 - t
    for _ in range(_CLIPS):
        end = min(t + step, 1.0)
        b0, b1, b2, b3 = _restrict((h0, h1, h2, h3), t, end)
        if not b0 > 0.0:
            return t
        if b1 > 0.0 and b2 > 0.0 and b3 > 0.0:
            if end == 1.0:
                return np.inf
            t, step = end, 2.0 * step
            continue
        # The hull of the control points reaches zero first on a line from one above to a later one below; the cubic
        # does not before. The next window is as long as this advance.
        share = min(
            min(_crossing(b0, b1, 0.0, 1.0), _crossing(b0, b2, 0.0, 2.0), _crossing(b0, b3, 0.0, 3.0)),
            min(_crossing(b1, b2, 1.0, 2.0), _crossing(b1, b3, 1.0, 3.0), _crossing(b2, b3, 2.0, 3.0)),
        )
        step = share * (end - t)
        if step < _RESOLUTION:
            return t
        t += step
    return t


@njit(cache=True, error_model="numpy")
def _crossing(first, second, i, j):
    """Return where the line between control points i and j comes down to zero, as a share of the window; 1: nowhere."""
    if first > 0.0 >= second:
        return (i + (j - i) * (first / (first - second))) / 3.0
    return 1.0


@njit(cache=True, error_model="numpy")
def _restrict(c, a, b):
    """Return the Bernstein coefficients over [a, b] of the cubic with coefficients c over [0, 1]: its blossom."""
    r, s = 1.0 - a, 1.0 - b
    p0, p1, p2 = r * c[0] + a * c[1], r * c[1] + a * c[2], r * c[2] + a * c[3]
    q0, q1, q2 = s * c[0] + b * c[1], s * c[1] + b * c[2], s * c[2] + b * c[3]
    aa0, aa1 = r * p0 + a * p1, r * p1 + a * p2
    bb0, bb1 = s * q0 + b * q1, s * q1 + b * q2
    return r * aa0 + a * aa1, s * aa0 + b * aa1, r * bb0 + a * bb1, s * bb0 + b * bb1
