"""Points of a plane, rows of an (N, 2) array, and linear motions in a step: a + s da, s from -1/2 to 1/2."""

from __future__ import annotations

from math import sqrt

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def difference(points, i, j):
    """Return the way from point i to point j."""
    return points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]


@njit(cache=True, error_model="numpy", forceinline=True)
def longest_sq(a, da):
    """Return a bound of the square of the length of a + s da for s from -1/2 to 1/2."""
    x, y = abs(a[0]) + 0.5 * abs(da[0]), abs(a[1]) + 0.5 * abs(da[1])
    return x * x + y * y


@njit(cache=True, error_model="numpy", forceinline=True)
def least_turn(a, da, b, db):
    """Return the least value of (a + s da) x (b + s db) for s from -1/2 to 1/2."""
    middle = a[0] * b[1] - a[1] * b[0]
    slope = a[0] * db[1] - a[1] * db[0] + da[0] * b[1] - da[1] * b[0]
    bend = da[0] * db[1] - da[1] * db[0]
    least = middle + 0.25 * bend - 0.5 * abs(slope)
    if bend > 0.0 and abs(slope) < bend:
        least = middle - 0.25 * slope * slope / bend
    return least


@njit(cache=True, error_model="numpy", forceinline=True)
def gap_sq(points, i, j):
    """Return the square of the distance of two points."""
    x, y = difference(points, i, j)
    return x * x + y * y


@njit(cache=True, error_model="numpy")
def segment_distance(points, i, j, k, m):
    """Return the distance of the segments ij and km in the plane."""
    if (
        _side(points, i, j, k) * _side(points, i, j, m) < 0.0  # where an end is on the other line, its distance tells
        and _side(points, k, m, i) * _side(points, k, m, j) < 0.0
    ):
        return 0.0
    return sqrt(
        min(
            _to_segment_sq(points, i, k, m),
            _to_segment_sq(points, j, k, m),
            _to_segment_sq(points, k, i, j),
            _to_segment_sq(points, m, i, j),
        )
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _side(points, i, j, k):
    a, b = difference(points, i, j), difference(points, i, k)
    return a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy", forceinline=True)
def _to_segment_sq(points, i, j, k):
    """Return the square of the distance of a point from a segment."""
    a, b = difference(points, j, k), difference(points, j, i)
    length_sq = a[0] * a[0] + a[1] * a[1]
    share = min(max((a[0] * b[0] + a[1] * b[1]) / length_sq, 0.0), 1.0) if length_sq > 0.0 else 0.0
    x, y = b[0] - share * a[0], b[1] - share * a[1]
    return x * x + y * y
