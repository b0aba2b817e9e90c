"""Sharpen whole-pixel matches to a few hundredths of a pixel, with a slanted window."""

from __future__ import annotations

import numpy as np
from numba import njit

SLANT_REACH = 1.5
"""Neighbours whose disparity differs by more than this from the plane's centre are another surface [px]."""

MAX_SHIFT = 1.0
"""A match that wants to move further than this was wrong [px]."""


@njit(cache=True, nogil=True)
def refine_disparity(  # type: ignore[no-untyped-def]  # typed by Numba
    left, right, disparity, shift, radius, widest, steps, min_correlation, precision
):
    """Refine each known disparity by least squares of brightness over a window that follows the surface's slant.

    Gruen 1985 (adaptive least-squares correlation), reduced to one unknown per pixel: the slant is that of the plane
    through the neighbouring disparities, brightness may differ by gain and offset. Where what is left over says that
    the window's texture does not fix the disparity well enough, the window grows.

    Args:
        left, right: Windows of the two rectified views, shape (H, W), uint8.
        disparity: Shape (H, W), float32; NaN where unknown.
        shift: Disparity at which the two windows coincide [px].
        radius, widest: Of the first window and of the last [px]; each is twice as wide as the one before.
        steps: Gauss-Newton steps in each window.
        min_correlation: Matches whose last windows correlate less are dropped.
        precision: Standard error of a disparity that is good enough [px].

    Returns:
        Shape (H, W), float32; NaN where unknown or refused.
    """
    height, width = disparity.shape
    refined = np.full((height, width), np.float32(np.nan), dtype=np.float32)
    side = 2 * widest + 1
    a, b, slope = np.empty(side * side), np.empty(side * side), np.empty(side * side)
    for row in range(radius, height - radius):
        for column in range(radius, width - radius):
            start = disparity[row, column]
            if np.isnan(start):
                continue
            best, reach = np.inf, radius
            d, dx, dy = _plane(disparity, row, column, radius)
            while best > precision and reach <= min(row, column, height - 1 - row, width - 1 - column):
                if reach > radius:
                    d, dx, dy = _plane(disparity, row, column, reach)
                count = (2 * reach + 1) ** 2
                moved, error, correlation = d, np.inf, 0.0
                for step in range(steps + 1):
                    if not _sample(left, right, row, column, moved - shift, dx, dy, reach, a, b, slope):
                        correlation = 0.0
                        break
                    change, correlation, error = _solve(a[:count], b[:count], slope[:count])
                    if step < steps:
                        moved += change
                        if not abs(moved - start) <= MAX_SHIFT:
                            correlation = 0.0
                            break
                if correlation >= min_correlation and error < best:
                    best, refined[row, column] = error, moved
                if reach == widest:
                    break
                reach = min(2 * reach, widest)
    return refined


@njit(cache=True, nogil=True)
def _plane(disparity, row, column, radius):  # type: ignore[no-untyped-def]  # typed by Numba
    """Least-squares plane through the neighbours on the same surface: value at the centre, slopes along x and y."""
    center = disparity[row, column]
    n = sx = sy = sxx = sxy = syy = sd = sxd = syd = 0.0
    for i in range(-radius, radius + 1):
        for j in range(-radius, radius + 1):
            value = disparity[row + i, column + j] - center
            if abs(value) <= SLANT_REACH:  # False for NaN
                n += 1.0
                sx += j
                sy += i
                sxx += j * j
                sxy += i * j
                syy += i * i
                sd += value
                sxd += j * value
                syd += i * value
    mxx, mxy, myy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
    mxd, myd = sxd - sx * sd / n, syd - sy * sd / n
    determinant = mxx * myy - mxy * mxy
    if n < 6 or determinant < 1e-6 * n * n:
        return center, 0.0, 0.0
    dx, dy = (mxd * myy - myd * mxy) / determinant, (myd * mxx - mxd * mxy) / determinant
    return center + (sd - dx * sx - dy * sy) / n, dx, dy


@njit(cache=True, nogil=True)
def _sample(left, right, row, column, offset, dx, dy, radius, a, b, slope):  # type: ignore[no-untyped-def]  # Numba
    """Fill the two windows' brightness and the right one's slope (Catmull-Rom); False beyond the picture."""
    width = right.shape[1]
    k = 0
    for i in range(-radius, radius + 1):
        for j in range(-radius, radius + 1):
            x = column + j - (offset + dx * j + dy * i)
            first = int(np.floor(x))
            if first < 1 or first + 2 >= width:
                return False
            t = x - first
            p0, p1 = float(right[row + i, first - 1]), float(right[row + i, first])
            p2, p3 = float(right[row + i, first + 1]), float(right[row + i, first + 2])
            c1, c2, c3 = 0.5 * (p2 - p0), p0 - 2.5 * p1 + 2 * p2 - 0.5 * p3, 0.5 * (p3 - p0) + 1.5 * (p1 - p2)
            a[k] = left[row + i, column + j]
            b[k] = p1 + t * (c1 + t * (c2 + t * c3))
            slope[k] = c1 + t * (2 * c2 + t * 3 * c3)
            k += 1
    return True


@njit(cache=True, nogil=True)
def _solve(a, b, slope):  # type: ignore[no-untyped-def]  # typed by Numba
    """Change of disparity that brings b, up to gain and offset, to a; how well they correlate now; its standard error
    from what is left over [px]."""
    ma, mb, ms = a.mean(), b.mean(), slope.mean()
    aa = ab = bb = bs = ss = rs = 0.0
    for k in range(len(a)):
        aa += (a[k] - ma) ** 2
        bb += (b[k] - mb) ** 2
        ab += (a[k] - ma) * (b[k] - mb)
    if aa < 1e-9 or bb < 1e-9:
        return 0.0, 0.0, np.inf
    gain = ab / bb
    for k in range(len(a)):
        s, u = gain * (slope[k] - ms), b[k] - mb
        bs += s * u
        ss += s * s
        rs += s * (gain * u - (a[k] - ma))
    ss -= bs * bs / bb  # the gain is an unknown, too
    correlation = ab / np.sqrt(aa * bb)
    if ss <= 1e-6 * aa:
        return 0.0, correlation, np.inf
    left_over = aa * (1.0 - correlation * correlation) / (len(a) - 3)
    return rs / ss, correlation, np.sqrt(left_over / ss)
