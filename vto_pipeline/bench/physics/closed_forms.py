"""Closed forms of mechanics: Bessel functions, elliptic integrals, exponentials."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipk, jn_zeros, jv

from vto_pipeline.model.arrays import FloatArray


def first_bessel_zero(order: float) -> float:
    """Return the first positive zero of J of this order, -1 < order < 0."""
    x = np.linspace(1e-6, 6.0, 601)
    first = int(np.argmax(jv(order, x) < 0.0))
    return float(brentq(lambda at: jv(order, at), x[first - 1], x[first], xtol=1e-14, rtol=1e-14))


def upright_strip() -> float:
    """Return w L³ / B at which a strip that stands on its clamped end buckles: 9/4 j²₋₁⸝₃ (Greenhill 1881)."""
    return 2.25 * first_bessel_zero(-1.0 / 3.0) ** 2


def lateral_buckling(poisson: float = 0.0) -> float:
    """Return Γ = w L³ / B, B = E h³/12, at which a strip on edge, clamped at one end, falls sideways.

    A thin strip (thickness « width « length) under its own weight: w b L³ / √(EI C) = 6 j₋₁⸝₆, with EI = B b and
    C = 2 B b / (1 + ν) (Timoshenko & Gere 1961, section 6.3).
    """
    return 6.0 * first_bessel_zero(-1.0 / 6.0) * float(np.sqrt(2.0 / (1.0 + poisson)))


def lateral_buckling_at_tip(poisson: float = 0.0) -> float:
    """Return P L² / (B b), as `lateral_buckling`, for a load P at the tip instead of weight: 2 j₋₁⸝₄."""
    return 2.0 * first_bessel_zero(-0.25) * float(np.sqrt(2.0 / (1.0 + poisson)))


def pendulum_period(amplitude: float) -> float:
    """Return T / T₀ of a rigid pendulum that swings to this angle [rad]: (2/π) K(sin²(θ/2))."""
    return float(2.0 / np.pi * ellipk(np.sin(0.5 * amplitude) ** 2))


def hanging_sheet_modes(count: int) -> FloatArray:
    """Return ω √(L/g) of a sheet hung from its top edge, without stiffness: j₀ₙ / 2 (D. Bernoulli 1732)."""
    return np.asarray(0.5 * jn_zeros(0, count))


def cantilever_modes(count: int) -> FloatArray:
    """Return ω L² √(ρ/B) of a weightless clamped strip: β², cos β cosh β = -1."""
    guesses = (np.arange(count) + 0.5) * np.pi
    roots = [brentq(lambda b: np.cos(b) + 1.0 / np.cosh(b), g - 1.0, g + 1.0, xtol=1e-14) for g in guesses]
    return np.array(roots) ** 2


def catenary(length: float) -> tuple[float, float]:
    """Return a / d and the sag / d of a chain of this length, in spans d: L = 2 a sinh(d / 2a)."""
    half = brentq(lambda u: np.sinh(u) / u - length, 1e-6, 50.0, xtol=1e-14)
    a = 0.5 / half
    return float(a), float(a * (np.cosh(half) - 1.0))


def hanging_strip(weight: float, stiffness: float, length: float) -> float:
    """Return how much longer a strip is for its weight per area [N/m²] and membrane stiffness [N/m]: w L² / 2Y [m]."""
    return weight * length**2 / (2.0 * stiffness)


def capstan(friction: float, wrap: float) -> float:
    """Return T₂ / T₁ of a strip that slips about a drum over this angle [rad]: exp(μ φ) (Euler 1769)."""
    return float(np.exp(friction * wrap))


def slide(friction: float, incline: float, gravity: float, h: float, steps: int) -> float:
    """Return how far a block slides in this many steps from rest [m], with (semi-)implicit Euler: a h² n (n + 1) / 2.

    a = g (sin θ - μ cos θ), or nothing where the slope does not exceed the friction.
    """
    acceleration = gravity * max(0.0, float(np.sin(incline) - friction * np.cos(incline)))
    return acceleration * h * h * steps * (steps + 1) / 2.0
