"""Sharpen whole-pixel matches to a few hundredths of a pixel, with a slanted window."""

from __future__ import annotations

import numpy as np
from numba import njit

SLANT_REACH = 1.5
"""Neighbours whose disparity differs by more than this from the plane's centre are another surface [px]."""

MAX_SHIFT = 1.0
"""A match that wants to move further than this was wrong [px]."""

SETTLED_PX = 0.02
"""A step shorter than this is the last one: a fifth of the standard error that is good enough [px]."""

FLAT = 1e-3
"""A window whose squared brightness adds up to less, about its mean, has no texture."""

_single = np.float32


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
        steps: Gauss-Newton steps in each window, at most.
        min_correlation: Matches whose last windows correlate less are dropped.
        precision: Standard error of a disparity that is good enough [px].

    Returns:
        Shape (H, W), float32; NaN where unknown or refused.
    """
    height, width = disparity.shape
    refined = np.full((height, width), np.float32(np.nan), dtype=np.float32)
    grey, cubics = left.astype(np.float32).reshape(-1), _cubics(right).reshape(-1)
    side = 2 * widest + 1
    a, b, slope = np.empty(side**2, np.float32), np.empty(side**2, np.float32), np.empty(side**2, np.float32)
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
                if dx >= 1.0:
                    break  # the right view would see it from behind
                moved, error, correlation = d, np.inf, 0.0
                half = reach * (1.0 - dx + abs(dy))
                for step in range(steps + 1):
                    offset = moved - shift
                    if not (column - offset - half >= 1.0 and column - offset + half < width - 2):
                        correlation = 0.0
                        break
                    moments = _moments(grey, cubics, width, row, column, offset, dx, dy, reach, a, b, slope)
                    change, correlation, error = _solve(moments, (2 * reach + 1) ** 2)
                    if step < steps:
                        moved += change
                        if not abs(moved - start) <= MAX_SHIFT:
                            correlation = 0.0
                            break
                        if abs(change) < SETTLED_PX:
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
def _cubics(picture):  # type: ignore[no-untyped-def]  # typed by Numba
    """Catmull-Rom coefficients of each row between a pixel and the next, shape (H, W, 4); 0 at the ends."""
    height, width = picture.shape
    found = np.zeros((height, width, 4), np.float32)
    for row in range(height):
        for k in range(1, width - 2):
            p0, p1 = float(picture[row, k - 1]), float(picture[row, k])
            p2, p3 = float(picture[row, k + 1]), float(picture[row, k + 2])
            found[row, k, 0], found[row, k, 1] = p1, 0.5 * (p2 - p0)
            found[row, k, 2], found[row, k, 3] = p0 - 2.5 * p1 + 2 * p2 - 0.5 * p3, 0.5 * (p3 - p0) + 1.5 * (p1 - p2)
    return found


@njit(cache=True, nogil=True, fastmath=True, forceinline=True)
def _moments(  # type: ignore[no-untyped-def]  # typed by Numba
    grey, cubics, width, row, column, offset, dx, dy, radius, a, b, slope
):
    """Sums over the window of the left brightness a, the right one b, its slope s and their products: a, b, s, aa, ab,
    bb, as, bs, ss. Both are counted from the left centre, so that single precision is enough.

    Flat arrays, unsigned indices and two passes, because the compiler makes vectors of the second only so.
    """
    side, stretch, center = 2 * radius + 1, _single(1.0 - dx), grey[np.uint64(row * width + column)]
    k = 0
    for i in range(-radius, radius + 1):
        x0 = column - offset - dy * i - (1.0 - dx) * radius
        whole = np.int64(np.floor(x0))
        into, first, start = _single(x0 - whole), (row + i) * width + whole, (row + i) * width + column - radius
        for j in range(side):
            x = into + stretch * _single(j)
            pixel = np.int32(x)
            t, p = x - _single(pixel), np.uint64(4 * (first + pixel))
            c1, c2, c3 = cubics[p + np.uint64(1)], cubics[p + np.uint64(2)], cubics[p + np.uint64(3)]
            a[k] = grey[np.uint64(start + j)] - center
            b[k] = cubics[p] - center + t * (c1 + t * (c2 + t * c3))
            slope[k] = c1 + t * (_single(2) * c2 + t * _single(3) * c3)
            k += 1
    sa = sb = ss = saa = sab = sbb = sas = sbs = sss = _single(0)
    for k in range(side * side):
        u, v, w = a[k], b[k], slope[k]
        sa, sb, ss = sa + u, sb + v, ss + w
        saa, sab, sbb = saa + u * u, sab + u * v, sbb + v * v
        sas, sbs, sss = sas + u * w, sbs + v * w, sss + w * w
    return sa, sb, ss, saa, sab, sbb, sas, sbs, sss


@njit(cache=True, nogil=True)
def _solve(moments, count):  # type: ignore[no-untyped-def]  # typed by Numba
    """Change of disparity that brings b, up to gain and offset, to a; how well they correlate now; its standard error
    from what is left over [px]."""
    a, b, s, aa, ab, bb, as_, bs, ss = moments
    a, b, s = float(a), float(b), float(s)
    aa, ab, bb = aa - a * a / count, ab - a * b / count, bb - b * b / count
    as_, bs, ss = as_ - a * s / count, bs - b * s / count, ss - s * s / count
    if aa < FLAT or bb < FLAT:
        return 0.0, 0.0, np.inf
    gain = ab / bb
    correlation = ab / np.sqrt(aa * bb)
    stiffness = gain * gain * (ss - bs * bs / bb)  # the gain is an unknown, too
    if stiffness <= 1e-6 * aa:
        return 0.0, correlation, np.inf
    left_over = aa * max(0.0, 1.0 - correlation * correlation) / (count - 3)
    return gain * (gain * bs - as_) / stiffness, correlation, np.sqrt(left_over / stiffness)
