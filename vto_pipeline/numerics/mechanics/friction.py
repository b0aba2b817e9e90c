"""Coulomb friction at the level of positions."""

from __future__ import annotations

from numba import njit

from vto_pipeline.numerics.vector import axpy, dot, norm, scale


@njit(cache=True, error_model="numpy")
def friction_shift(slip, normal, push, coefficient):
    """Return the shift [m] that friction adds to a vertex.

    Macklin et al. 2014, "Unified particle physics", eq. 24: the normal force moved the vertex by `push` along
    `normal` in this step, so friction may undo at most coefficient * push of the tangential part of its `slip`
    against the body.
    """
    tangential = axpy(-dot(slip, normal), normal, slip)
    length = norm(tangential)
    if length <= coefficient * push:
        return scale(-1.0, tangential)
    return scale(-coefficient * push / length, tangential)
