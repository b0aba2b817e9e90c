"""Strain limiting: nothing inside the limits, a stiff or rigid stop beyond; Provot 1995, as an inequality constraint.

Warp and weft stop at a tensile strain, shear at an angle to either side, where the threads of a weave lock. The strains
are those of `mechanics.membrane.thread_strains`. With a compliance, energy ½ (excess)² / α; with none, rigid.
In XPBD λ must pull back: the three rows are solved one after the other with λ clamped (projected Gauss-Seidel), whose
fixed point is that of the complementarity problem.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.cloth.constraints.membrane.triangle import (
    add_pulls,
    deformed,
    fill_rows,
    solve_bounded,
    triangles,
    write_stiffness,
)
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.membrane import pulls, thread_strains
from vto_pipeline.numerics.mechanics.plane_stress import scaled
from vto_pipeline.numerics.mechanics.tension import exact_thread_tension, thread_tension
from vto_pipeline.numerics.vector import scale


class StrainLimit(NamedTuple):
    """Strain limits.

    Args:
        vertices, gradients, area, starts, colours: See `triangle.Triangles`.
        limits: Largest warp strain, weft strain, and shear angle [rad] to either side, shape (3,); inf for none.
        compliance: Beyond the limits (warp, weft, shear) [m/N], shape (3,); zero is rigid.
        damping: Rayleigh's β [s].
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]
    limits: NDArray[np.float64]
    compliance: NDArray[np.float64]
    damping: float


def strain_limit(
    faces: NDArray[np.int32],
    rest: RestShape,
    limits: ArrayLike,
    compliance: ArrayLike,
    damping: float = 0.0,
) -> StrainLimit:
    """Return limits for these triangles; warp is as `yarns.thread_axes` says.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
        limits: Largest warp strain, weft strain and shear angle [rad], shape (3,); inf for none.
        compliance: Beyond them [m/N], shape (3,); zero is rigid, for solvers that can take it.
        damping: Rayleigh's β [s].
    """
    return StrainLimit(*triangles(faces, rest), np.array(limits, np.float64), np.array(compliance, np.float64), damping)


@njit(cache=True, error_model="numpy", forceinline=True)
def _beyond(strain, limits):
    """Return how far each strain is beyond its limit, for shear the limit on its own side; negative is inside."""
    shear = strain[2] - limits[2] if strain[2] > 0.0 else -strain[2] - limits[2]
    return strain[0] - limits[0], strain[1] - limits[1], shear


@njit(cache=True, error_model="numpy", forceinline=True)
def _stop(excess, compliance, area):
    """Return the stiffness at work and the force, both times the area; nothing inside the limit."""
    stiff = area / compliance if excess != 0.0 else 0.0
    return stiff, (stiff * excess if excess != 0.0 else 0.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _stops(strain, data, area):
    """Return the excess, the stiffness and the stress of the three strains, the last two times the area."""
    warp, weft, shear = _beyond(strain, data.limits)
    warp, weft, shear = max(warp, 0.0), max(weft, 0.0), max(shear, 0.0)
    shear = shear if strain[2] > 0.0 else -shear
    stiff_u, stress_u = _stop(warp, data.compliance[0], area)
    stiff_v, stress_v = _stop(weft, data.compliance[1], area)
    stiff_s, stress_s = _stop(shear, data.compliance[2], area)
    return (warp, weft, shear), (stiff_u, stiff_v, stiff_s, 0.0), (stress_u, stress_v, stress_s)


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(t, x, start, inverse_mass, data, multipliers, h):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    warp, weft, shear = _beyond(strain, data.limits)
    idle = multipliers[t, 0] == 0.0 and multipliers[t, 1] == 0.0 and multipliers[t, 2] == 0.0
    if idle and warp <= 0.0 and weft <= 0.0 and shear <= 0.0:
        return
    low, high = -np.inf, 0.0
    if strain[2] <= 0.0:
        shear, low, high = -shear, 0.0, np.inf
    soft = scaled((data.compliance[0], data.compliance[1], data.compliance[2], 0.0), 1.0 / (data.area[t] * h * h))
    least, most = (-np.inf, -np.inf, low), (0.0, 0.0, high)
    solve_bounded(t, x, start, inverse_mass, data, soft, multipliers, (warp, weft, shear), slopes, h, least, most)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(t, x, data, forces):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    excess, _, stress = _stops(strain, data, data.area[t])
    pull_u, pull_v = pulls(scale(-1.0, stress), slopes)
    add_pulls(t, forces, data, pull_u, pull_v)
    return 0.5 * (excess[0] * stress[0] + excess[1] * stress[1] + excess[2] * stress[2])


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(t, x, data, values, gradients, compliance):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    excess, _, _ = _stops(strain, data, data.area[t])
    values[0], values[1], values[2] = excess
    soft = scaled((data.compliance[0], data.compliance[1], data.compliance[2], 0.0), 1.0 / data.area[t])
    fill_rows(t, data, slopes, soft, gradients, compliance)
    for row in range(3):
        if values[row] == 0.0:  # inside its limit a row resists nothing; a compliance keeps it solvable
            gradients[row] = 0.0
            compliance[row, row] = 1.0


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(t, x, data, material, stress, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    _, stiff, pull = _stops(strain, data, data.area[t])
    tension = thread_tension(scale(stress, pull), slopes, frame)
    write_stiffness(t, data, scaled(stiff, material), slopes, tension, blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _exact(t, x, data, material, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    _, stiff, pull = _stops(strain, data, data.area[t])
    write_stiffness(t, data, scaled(stiff, material), slopes, exact_thread_tension(pull, slopes, frame), blocks)


KIND = Kind(StrainLimit, 3, _project, _force, _linearise, None, _stiffness, exact=_exact)
