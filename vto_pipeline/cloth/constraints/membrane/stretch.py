"""Membrane: an orthotropic sheet that resists warp, weft and shear strain of its threads.

Energy ½ A εᵀ K ε with the strains of `mechanics.membrane.thread_strains` and the plane-stress stiffness K of the fabric
[N/m]; its compliance in XPBD is K⁻¹ / A (Macklin 2016, eq. 2). The three are solved together (a 3 x 3 system), so that
warp, weft and Poisson's coupling act at once.
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
from vto_pipeline.errors import InputError
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.membrane import pulls, thread_strains
from vto_pipeline.numerics.mechanics.plane_stress import inverse_compliance, plane_stress, scaled
from vto_pipeline.numerics.mechanics.tension import exact_thread_tension, thread_tension
from vto_pipeline.numerics.vector import dot, scale


class Stretch(NamedTuple):
    """Membrane constraints.

    Args:
        vertices, gradients, area, starts, colours: See `triangle.Triangles`.
        compliance: K⁻¹ as (warp, weft, shear, warp-weft) [m/N], shape (4,).
        damping: Rayleigh's β, loss in proportion to stiffness [s].
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]
    compliance: NDArray[np.float64]
    damping: float


def stretch(faces: NDArray[np.int32], rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Stretch:
    """Return the membrane of these triangles; warp is as `yarns.thread_axes` says.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
        fabric: Stiffnesses.
        damping: Rayleigh's β [s].

    Raises:
        InputError: Poisson's ratio makes the sheet give energy away.
    """
    return Stretch(*triangles(faces, rest), orthotropic(fabric), damping)


def orthotropic(fabric: Fabric) -> NDArray[np.float64]:
    """Return the plane-stress compliance (warp, weft, shear, warp-weft) of a fabric [m/N], shape (4,).

    Raises:
        InputError: Poisson's ratio makes the sheet give energy away.
    """
    if fabric.poisson**2 * fabric.stretch_weft >= fabric.stretch_warp:
        raise InputError(
            f"fabric {fabric.name}: poisson {fabric.poisson} with warp {fabric.stretch_warp} and weft "
            f"{fabric.stretch_weft} N/m is not a stable material; expected poisson² · weft < warp"
        )
    warp, weft, shear = 1.0 / fabric.stretch_warp, 1.0 / fabric.stretch_weft, 1.0 / fabric.shear
    return np.array([warp, weft, shear, -fabric.poisson * warp])


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(t, x, start, inverse_mass, data, multipliers, h):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    soft = scaled(data.compliance, 1.0 / (data.area[t] * h * h))
    solve_strains(t, x, start, inverse_mass, data, soft, multipliers, strain, slopes, h)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(t, x, data, forces):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    stress = plane_stress(strain, data.compliance)
    pull_u, pull_v = pulls(scale(-data.area[t], stress), slopes)
    add_pulls(t, forces, data, pull_u, pull_v)
    return 0.5 * data.area[t] * dot(stress, strain)


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(t, x, data, values, gradients, compliance):
    fu, fv = deformed(t, x, data)
    strain, slopes, _ = thread_strains(fu, fv)
    values[0], values[1], values[2] = strain
    soft = scaled(data.compliance, 1.0 / data.area[t])
    fill_rows(t, data, slopes, soft, gradients, compliance)


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(t, x, data, material, stress, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    tension = thread_tension(scale(stress * data.area[t], plane_stress(strain, data.compliance)), slopes, frame)
    write_stiffness(t, data, inverse_compliance(data.compliance, material * data.area[t]), slopes, tension, blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _exact(t, x, data, material, blocks):
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    tension = exact_thread_tension(scale(data.area[t], plane_stress(strain, data.compliance)), slopes, frame)
    write_stiffness(t, data, inverse_compliance(data.compliance, material * data.area[t]), slopes, tension, blocks)


KIND = Kind(Stretch, 3, _project, _force, _linearise, None, _stiffness, exact=_exact)
