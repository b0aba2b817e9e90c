"""The step of one scalar XPBD constraint."""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def multiplier_step(value, weight, soft, multiplier, change, viscous):
    """Return Δλ = (-C - α̃ λ - γ ∇C·(x - xⁿ)) / ((1 + γ) ∇C W ∇Cᵀ + α̃); Macklin et al. 2016, eq. 26.

    Args:
        value: C.
        weight: ∇C W ∇Cᵀ, positive.
        soft: α̃ = α / h².
        multiplier: λ so far in this step.
        change: ∇C·(x - xⁿ); not used when there is no damping.
        viscous: γ = β / h, with the damping coefficient c = β k.
    """
    return (-value - soft * multiplier - viscous * change) / ((1.0 + viscous) * weight + soft)


@njit(cache=True, error_model="numpy", forceinline=True)
def bounded_step(diagonal, right, multiplier, low, high):
    """Return Δλ = right / diagonal, cut such that λ + Δλ stays between low and high; zero where nothing can move."""
    if diagonal <= 0.0:
        return 0.0
    return min(max(multiplier + right / diagonal, low), high) - multiplier
