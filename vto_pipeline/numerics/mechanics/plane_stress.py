"""Hooke's law of an orthotropic sheet: stress of strain, both as (warp, weft, shear).

A compliance or stiffness is the four numbers (warp, weft, shear, warp-weft) of a symmetric 3 x 3 matrix.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def plane_stress(strain, soft):
    """Return the stress of strain, for a compliance (warp, weft, shear, warp-weft)."""
    det = soft[0] * soft[1] - soft[3] * soft[3]
    return (
        (soft[1] * strain[0] - soft[3] * strain[1]) / det,
        (soft[0] * strain[1] - soft[3] * strain[0]) / det,
        strain[2] / soft[2],
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def scaled(soft, factor):
    """Return a compliance or stiffness times a factor."""
    return factor * soft[0], factor * soft[1], factor * soft[2], factor * soft[3]


@njit(cache=True, error_model="numpy", forceinline=True)
def inverse_compliance(soft, factor):
    """Return the stiffness of a compliance, times a factor."""
    over = factor / (soft[0] * soft[1] - soft[3] * soft[3])
    return over * soft[1], over * soft[0], factor / soft[2], -over * soft[3]
