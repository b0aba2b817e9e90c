"""Membrane as in finite elements: Green-Lagrange strain E = ½ (FᵀF - I), orthotropic St. Venant-Kirchhoff.

Energy ½ A (E_uu, E_vv, 2 E_uv) K (E_uu, E_vv, 2 E_uv)ᵀ on linear triangles, with the plane stress of E_warp, E_weft, ν
and G [N/m]; as an XPBD constraint the compliance is K⁻¹ / A (Macklin 2016, section 5). Polynomial in the positions,
and soft under strong compression: a triangle squeezed to nothing has only a finite energy, and no force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.cloth.constraints.membrane.stretch import orthotropic
from vto_pipeline.cloth.constraints.membrane.triangle import add_pulls, deformed, fill_rows, solve_strains, triangles
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.mechanics.membrane import green_strains, pulls
from vto_pipeline.numerics.mechanics.plane_stress import plane_stress, scaled
from vto_pipeline.numerics.mechanics.tension import tensile
from vto_pipeline.numerics.vector import dot, scale


class Green(NamedTuple):
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


def green(faces: NDArray[np.int32], rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Green:
    """Return the membrane of these triangles; warp is as `yarns.thread_axes` says.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
        fabric: Stiffnesses.
        damping: Rayleigh's β [s].

    Raises:
        InputError: Poisson's ratio makes the sheet give energy away.
    """
    return Green(*triangles(faces, rest), orthotropic(fabric), damping)


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(t, x, start, inverse_mass, data, multipliers, h):
    fu, fv = deformed(t, x, data)
    strain, slopes = green_strains(fu, fv)
    soft = scaled(data.compliance, 1.0 / (data.area[t] * h * h))
    solve_strains(t, x, start, inverse_mass, data, soft, multipliers, strain, slopes, h)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(t, x, data, forces):
    fu, fv = deformed(t, x, data)
    strain, slopes = green_strains(fu, fv)
    stress = plane_stress(strain, data.compliance)
    pull_u, pull_v = pulls(scale(-data.area[t], stress), slopes)
    add_pulls(t, forces, data, pull_u, pull_v)
    return 0.5 * data.area[t] * dot(stress, strain)


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(t, x, data, values, gradients, compliance):
    fu, fv = deformed(t, x, data)
    strain, slopes = green_strains(fu, fv)
    values[0], values[1], values[2] = strain
    soft = scaled(data.compliance, 1.0 / data.area[t])
    fill_rows(t, data, slopes, soft, gradients, compliance)


@njit(cache=True, error_model="numpy", forceinline=True)
def _geometric(t, x, data, blocks):
    """Add S_ab g_i^a g_j^b in every direction of space, with the tensile part of the second Piola-Kirchhoff S."""
    fu, fv = deformed(t, x, data)
    strain, _ = green_strains(fu, fv)
    stress = scale(data.area[t], plane_stress(strain, data.compliance))
    uu, vv, uv = tensile(stress[0], stress[1], stress[2])
    g = data.gradients
    for i in range(3):
        du, dv = uu * g[t, 2 * i] + uv * g[t, 2 * i + 1], uv * g[t, 2 * i] + vv * g[t, 2 * i + 1]
        for j in range(3):
            along = du * g[t, 2 * j] + dv * g[t, 2 * j + 1]
            for k in range(3):
                blocks[i, j, k, k] += along


KIND = Kind(Green, 3, _project, _force, _linearise, _geometric)
