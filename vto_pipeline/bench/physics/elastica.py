"""Inextensible strips that bend: the ordinary differential equations, solved to 1e-10.

Lengths are in units of the strip's length L, forces per width in units of B / L², with the bending rigidity B.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import OptimizeResult as OdeResult
from scipy.optimize import brentq, root

from vto_pipeline.model.arrays import FloatArray

_TOLERANCES: Any = {"rtol": 1e-12, "atol": 1e-14}
_CLAMPED_PINNED = 4.493409457909064  # first root of tan k = k
_STEEPEST = 1e-60  # tangent of a tip that hangs plumb, as far as floats can tell


@dataclass(frozen=True)
class Elastica:
    """A strip clamped level at one end, its shape from the clamp to the tip.

    Args:
        arc: Length along the strip, shape (N,).
        reach: Level distance from the clamp, shape (N,).
        drop: Distance below the clamp, shape (N,).
        slope: Angle below level [rad], shape (N,).
        root_curvature: At the clamp.
    """

    arc: FloatArray
    reach: FloatArray
    drop: FloatArray
    slope: FloatArray
    root_curvature: float


def cantilever(gamma: float, tip: float = 0.0, points: int = 201) -> Elastica:
    """Return the shape of a strip under its own weight and a load at its tip.

    With ψ the angle to the plumb line and t the length from the tip: ψ'' = (Γ t + P) sin ψ, ψ'(0) = 0, ψ(1) = π/2;
    what is sought is ψ(0), on a logarithmic scale, since long strips hang nearly plumb (Peirce 1930; Love 1927).

    Args:
        gamma: Γ = w L³ / B, with the weight per area w.
        tip: P L² / B, with the load per width P.
        points: N.
    """

    def solved(log_tip: float, at: FloatArray | None = None) -> OdeResult:
        tangent = np.exp(log_tip)  # ψ = tangent · η, so that tolerances hold for a tip as near to plumb as may be

        def slopes(t: float, y: FloatArray) -> list[float]:
            psi = tangent * y[0]
            return [y[1], (gamma * t + tip) * np.sin(psi) / tangent, np.sin(psi), np.cos(psi)]

        def level(t: float, y: FloatArray) -> float:
            return float(tangent * y[0] - 0.5 * np.pi)

        level.terminal = at is None  # type: ignore[attr-defined]
        return solve_ivp(slopes, (0.0, 1.0), [1.0, 0.0, 0.0, 0.0], "DOP853", at, events=level, **_TOLERANCES)

    def short_of_level(log_tip: float) -> float:
        found = solved(log_tip)
        turned = np.exp(log_tip) * found.y[0, -1] - 0.5 * np.pi
        return float(1.0 - found.t[-1]) if found.status == 1 else float(turned)

    log_tip = brentq(short_of_level, np.log(_STEEPEST), np.log(0.6 * np.pi), xtol=1e-13)
    t = np.linspace(0.0, 1.0, points)
    psi, bent, across, down = solved(log_tip, t).y
    psi, bent = np.exp(log_tip) * psi, np.exp(log_tip) * bent
    return Elastica(
        1.0 - t[::-1], (across[-1] - across)[::-1], (down[-1] - down)[::-1], 0.5 * np.pi - psi[::-1], float(bent[-1])
    )


def bending_length(chord_angle: float) -> float:
    """Return c / L = Γ^(-1/3) of the strip whose tip is seen at this angle below level from the clamp [rad]."""

    def excess(log_gamma: float) -> float:
        strip = cantilever(np.exp(log_gamma), points=2)
        return float(np.arctan2(strip.drop[-1], strip.reach[-1])) - chord_angle

    return float(np.exp(-brentq(excess, np.log(1e-2), np.log(1e4), xtol=1e-12) / 3.0))


@dataclass(frozen=True)
class HeldStrip:
    """A weightless strip clamped plumb at its top, its tip pinned straight below.

    Args:
        across: Level force on the tip.
        down: Plumb force on the tip.
        clamp_curvature: At the clamp.
        shape: Distance from the plumb line and below the clamp, at even steps from the clamp to the tip, shape (N, 2).
    """

    across: float
    down: float
    clamp_curvature: float
    shape: FloatArray

    @property
    def farthest(self) -> float:
        """Largest distance from the plumb line."""
        return float(np.abs(self.shape[:, 0]).max())

    @property
    def holding_friction(self) -> float:
        """Coefficient of friction below which a tip that stands on a floor slips."""
        return self.across / self.down


def held_strip(shortening: float) -> HeldStrip:
    """Return the forces on the tip of a strip that has been pushed down by this share of its length.

    θ'' = -P sin θ - Q cos θ, θ(0) = 0, θ'(1) = 0, and the tip lies below the clamp: the first branch, which leaves
    the straight strip at the Euler load tan k = k, P = k² = 20.19. The way there is followed from small shortening.
    """
    first = min(shortening, 1e-3)
    bent = _small_curvature(first)
    unknown = np.array([bent, _CLAMPED_PINNED**2, bent])
    for part in np.linspace(first, shortening, 2 + int(shortening / 0.06)):
        found = root(lambda y, part=part: _mismatch(y, part), unknown, tol=1e-11)
        unknown = found.x
    shape = _held_shape(unknown)
    return HeldStrip(abs(unknown[2]), unknown[1], abs(unknown[0]), shape[2:].T)


@cache
def slipping_strip(friction: float) -> float:
    """Return the shortening from which the tip of a `held_strip` slips on a floor, by share of the length.

    Args:
        friction: Coefficient, up to 0.33: from there the strip's belly would be under the floor.
    """
    return float(brentq(lambda share: held_strip(share).holding_friction - friction, 1e-3, 0.32, xtol=1e-6))


def _small_curvature(shortening: float) -> float:
    """Return the curvature at the clamp, and with it the force across, of the mode that shortens it so little."""
    k, s = _CLAMPED_PINNED, np.linspace(0.0, 1.0, 2001)
    slope = np.cos(k * s) + k * np.sin(k * s) - 1.0  # its curvature at the clamp is k²
    shorter = 0.5 * float(np.trapezoid(slope**2, s))
    return float(k * k * np.sqrt(shortening / shorter))


def _held_shape(unknown: FloatArray) -> FloatArray:
    curvature, down, across = unknown

    def slopes(s: float, y: FloatArray) -> list[float]:
        return [y[1], -down * np.sin(y[0]) - across * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])]

    at = np.linspace(0.0, 1.0, 201)
    return np.asarray(solve_ivp(slopes, (0.0, 1.0), [0.0, curvature, 0.0, 0.0], "DOP853", at, **_TOLERANCES).y)


def _mismatch(unknown: FloatArray, shortening: float) -> FloatArray:
    _, bent, across, down = _held_shape(unknown)[:, -1]
    return np.array([bent, across, down - (1.0 - shortening)])
