"""A heavy strip over a table's edge: its shape by relaxation, quick enough for a fit that needs thousands.

Lengths are in units of the overhang L. With the angle θ below level, the weight per area w and the bending rigidity B:
θ'' = -Γ (1 - s) cos θ, Γ = w L³ / B, θ(0) the edge's own angle, θ'(1) the natural curvature (Peirce 1930; Love 1927).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from vto_pipeline.errors import ComputationError, InputError
from vto_pipeline.model.arrays import FloatArray

STEEPEST, FLATTEST = np.radians(85.0), np.radians(4.0)
"""Chord angles between which an angle says something about the rigidity."""

_NODES = 401
_ARC = np.linspace(0.0, 1.0, _NODES)
_MOST_STEPS = 60


def hanging(gamma: float, curl: float = 0.0, edge: float = 0.0) -> FloatArray:
    """Return the angle below level [rad] at even steps from the edge to the tip, shape (401,).

    Newton's method on central differences; the error in shape is below 1e-4 of the overhang up to Γ = 100.

    Args:
        gamma: Γ.
        curl: Curvature without load, times the overhang; positive bends downwards.
        edge: Angle below level at the edge [rad].

    Raises:
        ComputationError: no shape found, as with a strip that curls up into a ring.
    """
    h = _ARC[1]
    pull = h * h * gamma * (1.0 - _ARC[1:])
    pull[-1] = h**3 * gamma / 6.0  # of the third derivative at the tip
    theta = edge + (0.5 * np.pi - edge) * (1.0 - np.exp(-gamma * _ARC[1:] / (3.0 + gamma ** (2.0 / 3.0))))
    bands = np.ones((3, _NODES - 1))
    for _ in range(_MOST_STEPS):
        before = np.concatenate([[edge], theta[:-1]])
        after = np.append(theta[1:], theta[-1] + h * curl)
        wrong = before - 2.0 * theta + after + pull * np.cos(theta)
        bands[1] = -2.0 - pull * np.sin(theta)
        bands[1, -1] += 1.0
        step = solve_banded((1, 1), bands, -wrong)
        largest = float(np.abs(step).max())
        theta = theta + step / max(1.0, largest)
        if largest < 1e-9:
            return np.concatenate([[edge], theta])
    raise ComputationError(f"no shape of a strip with Γ = {gamma:.3g} and a curl of {curl:.3g} was found")


def path(theta: FloatArray) -> FloatArray:
    """Return the points of a strip from its angles, from the edge at the origin, +y up; shape (N, 2)."""
    ahead = np.column_stack([np.cos(theta), -np.sin(theta)])
    steps = 0.5 * (ahead[1:] + ahead[:-1]) / (len(theta) - 1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def gamma_of_angle(chord: float) -> float:
    """Return Γ of a strip without curl whose tip is seen at this angle below level from a level edge [rad].

    Raises:
        InputError: the angle is so flat or so steep that it says nothing about the rigidity.
    """
    if not FLATTEST <= chord <= STEEPEST:
        allowed = f"{np.degrees(FLATTEST):.0f} to {np.degrees(STEEPEST):.0f}°"
        hint = "a longer overhang hangs more, a shorter one less; 41.5° is usual"
        raise InputError(f"angle: {np.degrees(chord):.1f}° cannot be resolved; expected {allowed}", hint=hint)

    def excess(log_gamma: float) -> float:
        across, up = path(hanging(float(np.exp(log_gamma))))[-1]
        return float(np.arctan2(-up, across)) - chord

    return float(np.exp(brentq(excess, np.log(0.1), np.log(3e3), xtol=1e-9)))
