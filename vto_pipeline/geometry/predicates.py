"""Exact signs of determinants: filtered first, exact arithmetic only where the filter cannot decide.

The exact part multiplies out the determinant and sums its terms without error (Shewchuk 1997, "Adaptive precision
floating-point arithmetic and fast robust geometric predicates": two-sum, two-product, grow-expansion).
"""

from __future__ import annotations

import numpy as np
from numba import njit

_EPS = 2.0**-53
_BOUND_2D = (3.0 + 16.0 * _EPS) * _EPS
_BOUND_3D = (7.0 + 56.0 * _EPS) * _EPS
_SPLITTER = 2.0**27 + 1.0


@njit(cache=True)
def orient2d(ax, ay, bx, by, cx, cy):  # type: ignore[no-untyped-def]
    """Return +1, 0 or -1: c left of, on, or right of the line from a to b."""
    left = (ax - cx) * (by - cy)
    right = (ay - cy) * (bx - cx)
    det = left - right
    bound = _BOUND_2D * (abs(left) + abs(right))
    if det > bound:
        return 1
    if det < -bound:
        return -1
    if bound == 0.0:
        return 0
    partial, count = np.empty(16), 0
    for u, v in ((ax, by), (bx, cy), (cx, ay), (-bx, ay), (-cx, by), (-ax, cy)):
        high, low = _two_product(u, v)
        count = _add(partial, count, low)
        count = _add(partial, count, high)
    return _sign_of_last(partial, count)


@njit(cache=True)
def orient3d(a, b, c, d):  # type: ignore[no-untyped-def]
    """Return +1, 0 or -1: d on the side from which a, b, c turn clockwise, on their plane, or on the other side.

    Args:
        a, b, c, d: Points, shape (3,) each. The sign is that of det[a-d, b-d, c-d].
    """
    adx, ady, adz = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bdx, bdy, bdz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cdx, cdy, cdz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    det = adz * (bdx * cdy - cdx * bdy) + bdz * (cdx * ady - adx * cdy) + cdz * (adx * bdy - bdx * ady)
    permanent = (
        abs(adz) * (abs(bdx * cdy) + abs(cdx * bdy))
        + abs(bdz) * (abs(cdx * ady) + abs(adx * cdy))
        + abs(cdz) * (abs(adx * bdy) + abs(bdx * ady))
    )
    bound = _BOUND_3D * permanent
    if det > bound:
        return 1
    if det < -bound:
        return -1
    if permanent == 0.0:
        return 0
    partial, count = np.empty(200), 0
    count = _add_determinant(partial, count, a, b, c, 1.0)
    count = _add_determinant(partial, count, a, b, d, -1.0)
    count = _add_determinant(partial, count, a, c, d, 1.0)
    count = _add_determinant(partial, count, b, c, d, -1.0)
    return _sign_of_last(partial, count)


@njit(cache=True)
def _two_product(x, y):  # type: ignore[no-untyped-def]
    """Return high and low part of x*y, exactly (Dekker 1971)."""
    high = x * y
    t = _SPLITTER * x
    xh = t - (t - x)
    xl = x - xh
    t = _SPLITTER * y
    yh = t - (t - y)
    yl = y - yh
    return high, xl * yl - (((high - xh * yh) - xl * yh) - xh * yl)


@njit(cache=True)
def _add(partial, count, x):  # type: ignore[no-untyped-def]
    """Add x to the expansion partial[:count] exactly; return its new length."""
    kept = 0
    for i in range(count):
        y = partial[i]
        high = x + y
        tail = high - x
        low = (x - (high - tail)) + (y - tail)
        if low != 0.0:
            partial[kept] = low
            kept += 1
        x = high
    partial[kept] = x
    return kept + 1


@njit(cache=True)
def _sign_of_last(partial, count):  # type: ignore[no-untyped-def]
    """Return the sign of an expansion: that of its largest part."""
    for i in range(count - 1, -1, -1):
        if partial[i] != 0.0:
            return 1 if partial[i] > 0.0 else -1
    return 0


@njit(cache=True)
def _add_determinant(partial, count, a, b, c, factor):  # type: ignore[no-untyped-def]
    """Add factor * det[a, b, c] to the expansion; return its new length."""
    for i, j, k, sign in (
        (0, 1, 2, 1.0),
        (1, 2, 0, 1.0),
        (2, 0, 1, 1.0),
        (0, 2, 1, -1.0),
        (2, 1, 0, -1.0),
        (1, 0, 2, -1.0),
    ):
        high, low = _two_product(a[i], b[j])
        for part in (low, high):
            p, e = _two_product(part, sign * factor * c[k])
            count = _add(partial, count, e)
            count = _add(partial, count, p)
    return count
