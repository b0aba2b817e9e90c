"""Closed forms of each integrator on an oscillator, and of implicit Euler on a spinning dumbbell."""

from __future__ import annotations

from cmath import sqrt
from collections.abc import Callable

import numpy as np


def _symplectic(z: complex) -> complex:
    """The root of r² - (2 - h²ω²) r + 1."""
    half = 1.0 + 0.5 * z * z
    return _outer(half, sqrt(half * half - 1.0))


def _bdf2(z: complex) -> complex:
    """The root of (3/2 - z) r² - 2 r + 1/2."""
    return _outer(2.0 / (3.0 - 2.0 * z), sqrt(1.0 + 2.0 * z) / (3.0 - 2.0 * z))


def _predictor_corrector(z: complex) -> complex:
    """The root of r² - (1 + z + 3/4 z²) r + z²/4: yₚ = y + z (3/2 y - 1/2 y₋) put into y₁ = y + z/2 (y + yₚ)."""
    half = 0.5 * (1.0 + z + 0.75 * z * z)
    return _outer(half, sqrt(half * half - 0.25 * z * z))


def _outer(middle: complex, half: complex) -> complex:
    return max(middle + half, middle - half, key=abs)


def _implicit_euler(z: complex) -> complex:
    return 1.0 / (1.0 - z)


def _trapezoid(z: complex) -> complex:
    return (1.0 + 0.5 * z) / (1.0 - 0.5 * z)


ROOTS: dict[str, Callable[[complex], complex]] = {
    "explicit_euler": lambda z: 1.0 + z,
    "symplectic_euler": _symplectic,
    "verlet": _symplectic,
    "leapfrog": _symplectic,
    "rk2": lambda z: 1.0 + z + z**2 / 2.0,
    "rk4": lambda z: 1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0,
    "predictor_corrector": _predictor_corrector,
    "backward_euler": _implicit_euler,
    "backward_euler_newton": _implicit_euler,
    "implicit_midpoint": _trapezoid,
    "bdf2": _bdf2,
    "newmark": _trapezoid,
    "imex": _implicit_euler,
    "ncg": _implicit_euler,
}
"""Integrator -> its characteristic root of largest modulus for y' = λ y, as a function of z = h λ.

For the oscillator λ = ± iω; the two forces-only schemes treat x and v differently and know only ω². One-step roots are
their stability functions (Hairer & Wanner 1996, IV.2); Newmark's is that of β = 1/4, γ = 1/2.
"""


def growth_and_frequency(name: str, h_omega: float) -> tuple[float, float]:
    """Return the growth per step and the ratio of the numerical to the true frequency of an undamped oscillator."""
    root = ROOTS[name](1j * h_omega)
    return abs(root), abs(float(np.angle(root))) / h_omega


def implicit_dumbbell(
    separation: tuple[float, float], speed: tuple[float, float], rest: float, omega_sq: float, h: float, steps: int
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the relative position [m] and velocity [m/s] of two masses on a spring after steps of implicit Euler.

    r₁ = r̃ - h²ω² (1 - l/|r₁|) r₁ with r̃ = r + h ṙ says that r₁ lies along r̃, with |r₁| = (|r̃| + h²ω² l) / (1 + h²ω²).

    Args:
        separation, speed: In the plane of the motion.
        rest: l [m].
        omega_sq: k (1/m₁ + 1/m₂) [1/s²].
        h: Step [s].
        steps: How many.
    """
    r, u = complex(*separation), complex(*speed)
    stiff = h * h * omega_sq
    for _ in range(steps):
        free = r + h * u
        new = free / abs(free) * (abs(free) + stiff * rest) / (1.0 + stiff)
        r, u = new, (new - r) / h
    return (r.real, r.imag), (u.real, u.imag)
