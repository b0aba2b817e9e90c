"""A spring in series with a slider: dry friction as an energy within a step.

Return mapping of rate-independent plasticity (Simo & Hughes 1998, "Computational inelasticity", box 1.5).
"""

from __future__ import annotations

from math import copysign, floor, pi

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def huber(extension, compliance, limit):
    """Return energy and force of the spring while the slider is where it is: ½ e²/α, but no steeper than the limit."""
    force = extension / compliance
    if abs(force) <= limit:
        return 0.5 * force * extension, force
    return limit * (abs(extension) - 0.5 * compliance * limit), copysign(limit, extension)


@njit(cache=True, error_model="numpy", forceinline=True)
def secant_compliance(extension, compliance, limit):
    """Return the compliance that gives the same force at this extension: α, or |e| / limit beyond."""
    return max(compliance, abs(extension) / limit)


@njit(cache=True, error_model="numpy", forceinline=True)
def slider_slip(extension, compliance, limit):
    """Return how far the slider goes until the spring holds no more than the limit."""
    held = compliance * limit
    return extension - min(max(extension, -held), held)


@njit(cache=True, error_model="numpy", forceinline=True)
def wrap_angle(angle):
    """Return the angle between -π and π."""
    return angle - 2.0 * pi * floor(0.5 * angle / pi + 0.5)
