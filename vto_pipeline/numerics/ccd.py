"""Continuous collision detection of vertex-face and edge-edge pairs: never late, despite rounding.

Both are one question. The differences between the points of the one and of the other fill a triangle (face less vertex)
or a parallelogram (edge less edge), and they touch when that figure holds the origin. Differences leave out what
all points have in common: far from the origin, or moving together, nothing is lost.

All points move in straight lines, so a plane between origin and figure can be followed exactly (`separation`). From the
time reached, planes are tried: the one across the way to the nearest point of the rim, which is fixed; the figure's
own, which turns; and the figure's own held fixed. The latest of their times is reached without contact, and the next
round begins there (conservative advancement, Mirtich 1996; with speeds in place of planes it is the additive CCD of
Li et al. 2021, "Codimensional incremental potential contact"). When none gets further, origin and figure touch, or are
nearer than the margins of rounding: that is the hit. Where rounds run out, the time reached is the answer: early, not
late. Contacts on the rim that turn in their own plane take the most rounds.

At the time of a hit the features are still apart: by 1e-13 of the size as a rule, by 1e-8 where they are nearly
parallel or without area; where rounds run out (one of fifty coplanar motions at the rim) by over 1e-6, at worst by
4e-3 of those tried. Misses by 1e-12 of the size are distinguished from hits.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.numerics.separation import (
    CUBIC_MARGIN,
    HEIGHT_MARGIN,
    UNDERFLOW,
    fixed_until,
    lerp,
    lowest_height,
    plane_cubic,
    plane_until,
    vector_to_rim,
)
from vto_pipeline.numerics.vector import cross, dot, load_at, norm, scale, sub, unit

LARGEST = 1e300
"""Coordinates beyond this could overflow in differences."""
_ROUNDS = 100
_WORTH = 2.0**-40  # of the time: a shorter advance is not worth another round
_WORTH_FIXED = 2.0**-30  # and with the figure's plane held fixed, which comes nearer by a share a round only
_SMALL, _LARGE = 2.0**-100, 2.0**100  # sizes whose cubes neither underflow nor overflow
_PARALLEL_FROM = 500  # queries


def vertex_face_impact(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first time at which each vertex and face touch, or inf.

    Args:
        start: Positions of the vertex and the face's corners at time 0 [m], shape (N, 4, 3).
        end: At time 1, along straight lines.

    Returns:
        Times in [0, 1], never later than the true ones; 0 for those that touch at the start. Shape (N,).

    Raises:
        InputError: A position is not finite or beyond 1e300, or the shapes are wrong.
    """
    return _impact(start, end, False)


def edge_edge_impact(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the first time at which the edges from row 0 to 1 and from row 2 to 3 touch, or inf.

    Args, returns and raises as `vertex_face_impact`.
    """
    return _impact(start, end, True)


@njit(cache=True, error_model="numpy")
def vertex_face_time(p0, a0, b0, c0, p1, a1, b1, c1, keep):
    """Return the first time in [0, 1] at which vertex p and face abc may be as near as `keep` of their distance at 0.

    Args:
        p0, a0, b0, c0: At time 0 [m], finite, below 1e300.
        p1, a1, b1, c1: At time 1, along straight lines.
        keep: Share of the distance at time 0, in [0, 1); 0: contact.

    Returns:
        Never late; inf: not by time 1. 0 when they touch at time 0, also when they then part.
    """
    return _first_time(sub(a0, p0), sub(b0, a0), sub(c0, a0), sub(a1, p1), sub(b1, a1), sub(c1, a1), False, keep)


@njit(cache=True, error_model="numpy")
def edge_edge_time(a0, b0, c0, d0, a1, b1, c1, d1, keep):
    """Return the same as `vertex_face_time` for the edges ab and cd."""
    return _first_time(sub(a0, c0), sub(b0, a0), sub(c0, d0), sub(a1, c1), sub(b1, a1), sub(c1, d1), True, keep)


@njit(cache=True, error_model="numpy")
def _first_time(x0, u0, v0, x1, u1, v1, four, keep):
    """Return when the figure with corner x and sides u, v (`four`: and fourth corner x + u + v) reaches the origin."""
    x_size, u_size, v_size = _largest(x0, x1), _largest(u0, u1), _largest(v0, v1)
    size = max(x_size, u_size, v_size)
    while 0.0 < size < _SMALL or _LARGE < size < np.inf:
        factor = _LARGE if size < 1.0 else _SMALL
        x0, u0, v0 = scale(factor, x0), scale(factor, u0), scale(factor, v0)
        x1, u1, v1 = scale(factor, x1), scale(factor, u1), scale(factor, v1)
        x_size, u_size, v_size, size = factor * x_size, factor * u_size, factor * v_size, factor * size
    height_margin = HEIGHT_MARGIN * size
    rim = vector_to_rim(x0, u0, v0, four)
    # Most queries end here. The rim is no nearer than the figure, so that much is kept at least.
    if fixed_until(unit(rim), keep * norm(rim) + height_margin, 0.0, x0, u0, v0, x1, u1, v1, four) == np.inf:
        return np.inf
    height, area = plane_cubic(x0, u0, v0, x1, u1, v1)
    cubic_margin = CUBIC_MARGIN * x_size * u_size * v_size + UNDERFLOW
    low = 0.0
    if keep > 0.0:  # the nearest point is on the rim, or inside and as near as the plane
        beside = lowest_height(unit(rim), x0, u0, v0, four) + height_margin
        low = keep * min(norm(rim), max(beside, (abs(height[0]) + cubic_margin) / area[0]))
    t = 0.0
    for _ in range(_ROUNDS):
        x, u, v = lerp(x0, x1, t), lerp(u0, u1, t), lerp(v0, v1, t)
        until = max(
            plane_until(height, area, low, cubic_margin, t),
            fixed_until(unit(vector_to_rim(x, u, v, four)), low + height_margin, t, x0, u0, v0, x1, u1, v1, four),
        )
        if not until - t > _WORTH:
            normal = unit(cross(u, v))
            normal = scale(math.copysign(1.0, dot(normal, x)), normal)
            until = max(until, fixed_until(normal, low + height_margin, t, x0, u0, v0, x1, u1, v1, four))
            if not until - t > _WORTH_FIXED:
                return t
        if until == np.inf:
            return np.inf
        t = until
    return t


@njit(cache=True, error_model="numpy")
def _largest(a, b):
    return max(abs(a[0]), abs(a[1]), abs(a[2]), abs(b[0]), abs(b[1]), abs(b[2]))


def _impact(start: NDArray[np.float64], end: NDArray[np.float64], edges: bool) -> NDArray[np.float64]:
    start, end = np.ascontiguousarray(start, np.float64), np.ascontiguousarray(end, np.float64)
    if start.shape != end.shape or start.shape[1:] != (4, 3):
        raise InputError(
            f"shapes of start and end are {start.shape} and {end.shape}", hint="both must be (N, 4, 3), in metres"
        )
    for name, array in (("start", start), ("end", end)):
        wrong = ~(np.abs(array) <= LARGEST)
        if wrong.any():
            query, point, axis = np.argwhere(wrong)[0]
            raise InputError(
                f"{name}[{query}, {point}, {axis}] is {array[query, point, axis]}",
                hint=f"positions must be finite and at most {LARGEST:g} in size",
            )
    times = np.empty(len(start))
    fill = _fill_serial if len(start) < _PARALLEL_FROM else _fill_parallel
    fill(start, end, edges, times)
    return times


@njit(cache=True, error_model="numpy", parallel=True)
def _fill_parallel(start, end, edges, times):
    for i in prange(len(start)):
        times[i] = _contact_time(start, end, i, edges)


@njit(cache=True, error_model="numpy")
def _fill_serial(start, end, edges, times):
    for i in range(len(start)):
        times[i] = _contact_time(start, end, i, edges)


@njit(cache=True, error_model="numpy")
def _contact_time(start, end, i, edges):
    a0, b0, c0, d0 = load_at(start, i, 0), load_at(start, i, 1), load_at(start, i, 2), load_at(start, i, 3)
    a1, b1, c1, d1 = load_at(end, i, 0), load_at(end, i, 1), load_at(end, i, 2), load_at(end, i, 3)
    if edges:
        return edge_edge_time(a0, b0, c0, d0, a1, b1, c1, d1, 0.0)
    return vertex_face_time(a0, b0, c0, d0, a1, b1, c1, d1, 0.0)
