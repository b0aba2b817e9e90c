"""A measured stress-strain curve as a monotone cubic: stress, tangent and energy at any strain.

Slopes by the weighted harmonic mean of Fritsch & Butland 1984, "A method for constructing local monotone piecewise
cubic interpolants", SIAM J. Sci. Stat. Comput. 5(2), which fulfils the monotonicity conditions of Fritsch & Carlson
1980, SIAM J. Numer. Anal. 17(2); three-point slopes at both ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.errors import InputError

_FLATTEST_END = 0.1  # of the secant beside it: a tangent of zero at rest, or in the continuation, resists nothing


class MonotoneCurve(NamedTuple):
    """Knots of a C1 cubic through the origin.

    Attributes:
        strain: Increasing from 0, shape (K,).
        stress: Force per width [N/m], increasing from 0, shape (K,).
        slope: Its derivative at the knots, positive [N/m], shape (K,).
        energy: Its integral from 0 [J/m²], shape (K,).
    """

    strain: NDArray[np.float64]
    stress: NDArray[np.float64]
    slope: NDArray[np.float64]
    energy: NDArray[np.float64]


def monotone_curve(strain: ArrayLike, stress: ArrayLike) -> MonotoneCurve:
    """Return the monotone cubic through measured points.

    Args:
        strain: Strictly increasing from 0, shape (K,), K >= 2.
        stress: Force per width [N/m], strictly increasing from 0, shape (K,).

    Raises:
        InputError: not finite, not strictly increasing, not from the origin, or fewer than two points.
    """
    x, y = np.asarray(strain, np.float64), np.asarray(stress, np.float64)
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise InputError(f"a stretch curve of shapes {x.shape} and {y.shape}; expected two equal rows of 2 or more")
    if x[0] != 0.0 or y[0] != 0.0:
        raise InputError(f"a stretch curve from ({x[0]}, {y[0]}); expected from the origin")
    width, secant = np.diff(x), np.diff(y) / np.diff(x)
    if not (np.isfinite(x).all() and np.isfinite(secant).all() and (width > 0).all() and (secant > 0).all()):
        raise InputError("a stretch curve must be finite and strictly increasing in strain and in force")
    slope = _slopes(width, secant)
    # ∫ of the Hermite cubic over one interval.
    steps = width * (y[:-1] + y[1:]) / 2 + width**2 * (slope[:-1] - slope[1:]) / 12
    return MonotoneCurve(x, y, slope, np.concatenate([[0.0], np.cumsum(steps)]))


def _slopes(width: NDArray[np.float64], secant: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slopes at the knots from the intervals' widths and secants, shapes (K - 1,)."""
    if len(width) == 1:
        return np.array([secant[0], secant[0]])
    left, right = width[:-1] + 2 * width[1:], 2 * width[:-1] + width[1:]
    inner = (left + right) / (left / secant[:-1] + right / secant[1:])
    return np.concatenate([[_end_slope(width, secant)], inner, [_end_slope(width[::-1], secant[::-1])]])


def _end_slope(width: NDArray[np.float64], secant: NDArray[np.float64]) -> float:
    """Slope at the first knot of the parabola through the first three, kept monotone and away from zero."""
    parabola = ((2 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1])
    return float(np.clip(parabola, _FLATTEST_END * secant[0], 3.0 * secant[0]))


@njit(cache=True, error_model="numpy")
def curve_at(curve, strain):
    """Return the energy [J/m²], the stress [N/m] and the tangent stiffness [N/m] at a strain.

    Compression, which the tests do not measure, goes on with the slope at rest; beyond the last knot the curve goes on
    with its last slope. Both continuations are C1.
    """
    if strain <= 0.0:
        first = curve.slope[0]
        return 0.5 * first * strain * strain, first * strain, first
    last = len(curve.strain) - 1
    if strain >= curve.strain[last]:
        beyond = strain - curve.strain[last]
        stress = curve.stress[last] + curve.slope[last] * beyond
        return curve.energy[last] + 0.5 * beyond * (curve.stress[last] + stress), stress, curve.slope[last]
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if strain < curve.strain[middle]:
            high = middle
        else:
            low = middle
    h = curve.strain[high] - curve.strain[low]
    t = (strain - curve.strain[low]) / h
    y0, rise = curve.stress[low], curve.stress[high] - curve.stress[low]
    m0, m1 = h * curve.slope[low], h * curve.slope[high]
    # y0 + t m0 + t² b + t³ a, the Hermite cubic on [0, 1]
    a, b = m0 + m1 - 2.0 * rise, 3.0 * rise - 2.0 * m0 - m1
    stress = y0 + t * (m0 + t * (b + t * a))
    tangent = (m0 + t * (2.0 * b + 3.0 * t * a)) / h
    return curve.energy[low] + h * t * (y0 + t * (m0 / 2.0 + t * (b / 3.0 + t * a / 4.0))), stress, tangent
