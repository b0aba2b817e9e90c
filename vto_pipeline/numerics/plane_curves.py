"""Curves in the plane: polylines, Bezier curves of any degree, and arcs of circles with a bulge.

A curve is given by its kind, its points (K, 2) and its bulge, as `model.pattern.Edge` has them.
"""

from __future__ import annotations

from math import atan, comb

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_PIECES = 32  # of a Bezier curve, each integrated by itself
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def curve_at(kind: str, points: Floats, bulge: float, t: Floats) -> Floats:
    """Return the points of a curve at parameters from 0 to 1, shape (N, 2); a polyline's parameter is its length."""
    if kind == "bezier":
        degree = len(points) - 1
        weights = np.stack([comb(degree, k) * t**k * (1.0 - t) ** (degree - k) for k in range(degree + 1)], axis=1)
        return np.asarray(weights @ points)
    if kind == "arc":
        center, start, angle = _circle(points, bulge)
        cos, sin = np.cos(angle * t), np.sin(angle * t)
        turned = np.stack([cos * start[0] - sin * start[1], sin * start[0] + cos * start[1]], axis=1)
        return np.asarray(center + turned)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.stack([np.interp(t * at[-1], at, points[:, k]) for k in range(2)], axis=1)


def curve_length(kind: str, points: Floats, bulge: float) -> float:
    """Return the length of a curve; closed form but for Bezier curves, which Gauss's rule integrates."""
    if kind == "arc":
        _, start, angle = _circle(points, bulge)
        return float(np.hypot(*start) * abs(angle))
    if kind == "bezier":
        return float(_bezier_lengths(points)[-1])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def at_shares(kind: str, points: Floats, bulge: float, shares: Floats) -> Floats:
    """Return the points of a curve at shares of its length from 0 to 1, shape (N, 2)."""
    if kind != "bezier":
        return curve_at(kind, points, bulge, shares)
    lengths = _bezier_lengths(points)
    t = np.interp(shares * lengths[-1], lengths, np.linspace(0.0, 1.0, len(lengths)))
    for _ in range(4):  # Newton's method on length(t) = share, each step with the exact length of the rest of a piece
        piece = np.minimum((t * _PIECES).astype(int), _PIECES - 1)
        speed = np.linalg.norm(_bezier_slope(points, t), axis=1)
        missing = shares * lengths[-1] - lengths[piece] - _arc_between(points, piece / _PIECES, t)
        t = np.clip(t + np.where(speed > 0.0, missing / np.where(speed > 0.0, speed, 1.0), 0.0), 0.0, 1.0)
    return curve_at(kind, points, bulge, t)


def curve_area(kind: str, points: Floats, bulge: float) -> float:
    """Return half the integral of x dy - y dx along a curve: summed over a closed outline, the area it encloses."""
    ends = points if kind == "polyline" else points[[0, -1]]
    chords = 0.5 * float((ends[:-1, 0] * ends[1:, 1] - ends[:-1, 1] * ends[1:, 0]).sum())
    if kind == "arc":
        _, start, angle = _circle(points, bulge)
        return chords + 0.5 * float(start @ start) * (angle - np.sin(angle))
    if kind == "bezier":
        t = 0.5 * (_NODES + 1.0)
        at, slope = curve_at(kind, points, bulge, t), _bezier_slope(points, t)
        return 0.25 * float(_WEIGHTS @ (at[:, 0] * slope[:, 1] - at[:, 1] * slope[:, 0]))
    return chords


def flatten(kind: str, points: Floats, bulge: float, tolerance: float) -> Floats:
    """Return a polyline that leaves the curve by no more than the tolerance, its ends exact, shape (N, 2)."""
    if kind == "polyline":
        return points
    if kind == "arc":
        _, start, angle = _circle(points, bulge)
        step = 4.0 * np.arcsin(np.sqrt(0.5 * min(tolerance / np.hypot(*start), 1.0)))  # 2 arccos(1 - x)
        count = int(np.ceil(abs(angle) / step))
    else:  # the second difference of the control points bounds how far a chord is off
        degree = len(points) - 1
        bend = degree * (degree - 1) * np.linalg.norm(np.diff(points, 2, axis=0), axis=1).max()
        count = int(np.ceil(np.sqrt(bend / (8.0 * tolerance))))
    flat = curve_at(kind, points, bulge, np.linspace(0.0, 1.0, max(count, 1) + 1))
    flat[[0, -1]] = points[[0, -1]]
    return flat


def _circle(points: Floats, bulge: float) -> tuple[Floats, Floats, float]:
    """Return center, the way from it to the start, and the signed angle of an arc."""
    chord = points[1] - points[0]
    across = np.array([-chord[1], chord[0]])
    center = 0.5 * (points[0] + points[1]) + across * (1.0 - bulge * bulge) / (4.0 * bulge)
    return center, points[0] - center, 4.0 * atan(bulge)


def _bezier_slope(points: Floats, t: Floats) -> Floats:
    return (len(points) - 1) * curve_at("bezier", np.diff(points, axis=0), 0.0, t)


def _arc_between(points: Floats, low: Floats, high: Floats) -> Floats:
    """Return the length of a Bezier curve between parameters, shape (N,)."""
    half = 0.5 * (high - low)
    t = (0.5 * (high + low))[:, None] + half[:, None] * _NODES
    speed = np.linalg.norm(_bezier_slope(points, t.ravel()), axis=1).reshape(t.shape)
    return np.asarray(half * (speed @ _WEIGHTS))


def _bezier_lengths(points: Floats) -> Floats:
    """Return the length from the start to each border of a piece, shape (_PIECES + 1,)."""
    t = np.linspace(0.0, 1.0, _PIECES + 1)
    return np.concatenate([[0.0], np.cumsum(_arc_between(points, t[:-1], t[1:]))])
