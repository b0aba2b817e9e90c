"""Outlines of flat pieces: where they turn sharply, and what they are without noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from vto_pipeline.model.arrays import FloatArray

_REACH_M = 0.02  # on both sides of a corner: shorter than any edge of a panel, longer than a wave of noise
_REACH = 0.05  # of the outline, where that is less
_TURN = np.deg2rad(35.0)
_ROUNDS = 14


def sharp_corners(points: FloatArray) -> NDArray[np.bool_]:
    """Return which points of a closed polyline are corners, shape (N,).

    At a corner the way there and the way on, seen over a short reach, differ by much, and by no less than nearby.

    Args:
        points: Its end left out [m], shape (N, 2).
    """
    sides = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    length = float(sides.sum())
    at = np.concatenate([[0.0], np.cumsum(sides)[:-1]])
    reach = min(_REACH_M, _REACH * length)
    ahead = _along(points, at + reach, length) - points
    behind = points - _along(points, at - reach, length)
    turn = np.abs(np.arctan2(behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0], (ahead * behind).sum(axis=1)))
    apart = np.abs(at[:, None] - at)
    near = np.minimum(apart, length - apart) < reach
    highest = turn >= np.where(near, turn, 0.0).max(axis=1)
    return np.asarray(highest & (turn > _TURN))


def smoothed(points: FloatArray, noise: float) -> FloatArray:
    """Return the polyline that bends least among those as far from a given one as its noise, its ends kept.

    Args:
        points: In order [m], shape (N, D).
        noise: Standard deviation in each direction [m].
    """
    count = len(points)
    if noise <= 0.0 or count < 4:
        return points
    kernel = np.convolve([1.0, -2.0, 1.0], [1.0, -2.0, 1.0])
    inner = points[1:-1] - _chord(points)[1:-1]  # the chord does not bend; about it, ends are at zero
    low, high = -4.0, 8.0
    found = inner
    for _ in range(_ROUNDS):
        middle = 0.5 * (low + high)
        bands = np.zeros((3, count - 2))
        bands[2], bands[1, 1:], bands[0, 2:] = 1.0 + 10.0**middle * kernel[2], 10.0**middle * kernel[1], 10.0**middle
        bands[2, [0, -1]] -= 10.0**middle
        found = solveh_banded(bands, inner)
        off = float(np.sqrt(np.mean((found - inner) ** 2)))
        low, high = (middle, high) if off < noise else (low, middle)
    return np.concatenate([points[:1], _chord(points)[1:-1] + found, points[-1:]])


def crosses_itself(points: FloatArray) -> bool:
    """Return whether a closed polyline, its end left out, shape (N, 2), crosses itself."""
    a, b = points, np.roll(points, -1, axis=0)
    side_a, side_b = _side(a, b, a), _side(a, b, b)  # (N, N): of each line, on which side each start and end lies
    apart = (side_a * side_b < 0.0) & (side_a * side_b < 0.0).T
    return bool(apart.any())


def _side(a: FloatArray, b: FloatArray, p: FloatArray) -> FloatArray:
    d, e = (b - a)[:, None], p[None] - a[:, None]
    return np.asarray(d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0])


def _chord(points: FloatArray) -> FloatArray:
    share = np.linspace(0.0, 1.0, len(points))[:, None]
    return np.asarray((1.0 - share) * points[0] + share * points[-1])


def _along(points: FloatArray, at: FloatArray, length: float) -> FloatArray:
    closed = np.concatenate([points, points[:1]])
    places = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    return np.stack([np.interp(at % length, places, closed[:, k]) for k in range(2)], axis=1)
