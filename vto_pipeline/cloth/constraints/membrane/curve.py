"""Membrane whose warp and weft follow measured curves of force against strain; shear is linear.

Volino, Magnenat-Thalmann & Faure 2009, "A simple approach to nonlinear tensile stiffness for accurate cloth
simulation", with monotone curves in place of polynomials. Energy A (W_warp(ε_u) + W_weft(ε_v) + ½ G γ²) with the
strains of `mechanics.membrane.thread_strains`; warp and weft do not know each other.

In XPBD one Newton step on the force: from λ + λ' = -h² A σ(ε + ∇ε W ∇εᵀ λ') follows the linear step with the tangent's
compliance α = 1 / (A σ') and C = σ / σ'. So the fixed point is that of implicit Euler, whatever the curve.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.cloth.constraints.membrane.triangle import (
    add_pulls,
    deformed,
    fill_rows,
    solve_strains,
    triangles,
    write_stiffness,
)
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.membrane import pulls, thread_strains
from vto_pipeline.numerics.mechanics.monotone_curve import MonotoneCurve, curve_at
from vto_pipeline.numerics.mechanics.plane_stress import scaled
from vto_pipeline.numerics.mechanics.tension import exact_thread_tension, thread_tension
from vto_pipeline.numerics.vector import scale

_FLATTEST = 1e-6  # tangent as a share of the slope at rest: where a curve is level, its compliance must stay finite


class Curve(NamedTuple):
    """Membrane constraints.

    Args:
        vertices, gradients, area, starts, colours: See `triangle.Triangles`.
        warp, weft: Force per width [N/m] against strain: the rows of a `numerics.monotone_curve`, shape (4, K).
        shear: Stiffness [N/m].
        damping: Rayleigh's β, loss in proportion to the tangent stiffness [s].
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]
    warp: NDArray[np.float64]
    weft: NDArray[np.float64]
    shear: float
    damping: float


def curve(
    faces: NDArray[np.int32],
    rest: RestShape,
    warp: MonotoneCurve,
    weft: MonotoneCurve,
    shear: float,
    damping: float = 0.0,
) -> Curve:
    """Return the membrane of these triangles; warp is as `yarns.thread_axes` says.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
        warp, weft: Measured curves.
        shear: Shear stiffness [N/m].
        damping: Rayleigh's β [s].
    """
    return Curve(*triangles(faces, rest), np.stack(warp), np.stack(weft), shear, damping)


@njit(cache=True, error_model="numpy", forceinline=True)
def _at(rows, strain):
    """Return energy [J/m²], stress and tangent [N/m] of one curve; the tangent is never quite level."""
    energy, stress, slope = curve_at(MonotoneCurve(rows[0], rows[1], rows[2], rows[3]), strain)
    return energy, stress, max(slope, _FLATTEST * rows[2, 0])


@njit(cache=True, error_model="numpy", forceinline=True)
def _law(strain, data):
    """Return the energy [J/m²], the stress (warp, weft, shear) and its tangent, four numbers [N/m]."""
    energy_u, stress_u, slope_u = _at(data.warp, strain[0])
    energy_v, stress_v, slope_v = _at(data.weft, strain[1])
    energy = energy_u + energy_v + 0.5 * data.shear * strain[2] * strain[2]
    return energy, (stress_u, stress_v, data.shear * strain[2]), (slope_u, slope_v, data.shear, 0.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _tangent_rows(stress, slope, factor):
    """Return C = σ / σ' and the tangent's compliance times a factor."""
    values = (stress[0] / slope[0], stress[1] / slope[1], stress[2] / slope[2])
    return values, (factor / slope[0], factor / slope[1], factor / slope[2], 0.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(t, x, start, inverse_mass, data, multipliers, h):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    _, stress, slope = _law(strain, data)
    values, soft = _tangent_rows(stress, slope, 1.0 / (data.area[t] * h * h))
    solve_strains(t, x, start, inverse_mass, data, soft, multipliers, values, slopes, h)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(t, x, data, forces):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    energy, stress, _ = _law(strain, data)
    pull_u, pull_v = pulls(scale(-data.area[t], stress), slopes)
    add_pulls(t, forces, data, pull_u, pull_v)
    return data.area[t] * energy


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(t, x, data, values, gradients, compliance):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    _, stress, slope = _law(strain, data)
    (values[0], values[1], values[2]), soft = _tangent_rows(stress, slope, 1.0 / data.area[t])
    fill_rows(t, data, slopes, soft, gradients, compliance)


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(t, x, data, material, stress, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    _, pull, slope = _law(strain, data)
    tension = thread_tension(scale(stress * data.area[t], pull), slopes, frame)
    write_stiffness(t, data, scaled(slope, material * data.area[t]), slopes, tension, blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _exact(t, x, data, material, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    _, pull, slope = _law(strain, data)
    tension = exact_thread_tension(scale(data.area[t], pull), slopes, frame)
    write_stiffness(t, data, scaled(slope, material * data.area[t]), slopes, tension, blocks)


KIND = Kind(Curve, 3, _project, _force, _linearise, None, _stiffness, exact=_exact)
