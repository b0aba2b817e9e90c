"""Internal friction of stretch and shear: a spring in series with a slider per triangle and strain.

As `constraints.bend_friction` for hinges: the loop in shear that KES measures is 2HG wide; in stretch what it calls
resilience is what is left of the work. With a high limit and part of the stiffness it is plastic strain with linear
hardening. Strains are those of `mechanics.membrane.thread_strains`, each with a slider of its own.
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
from vto_pipeline.numerics.mechanics.slider import huber, secant_compliance, slider_slip
from vto_pipeline.numerics.mechanics.tension import thread_tension
from vto_pipeline.numerics.vector import load, scale, sub


class StrainFriction(NamedTuple):
    """Sliders of strains.

    Args:
        vertices, gradients, area, starts, colours: See `triangle.Triangles`.
        slider: How far the sliders (warp, weft, shear) have gone, shape (T, 3); changed by `slip`.
        compliance: Of the springs (warp, weft, shear) [m/N], shape (3,); 1 where there is no friction.
        limit: Force per width at which the sliders give way [N/m], shape (3,); zero for none.
        damping: Zero: the damper is that of what is elastic beside it.
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]
    slider: NDArray[np.float64]
    compliance: NDArray[np.float64]
    limit: NDArray[np.float64]
    damping: float


def strain_friction(
    faces: NDArray[np.int32],
    rest: RestShape,
    slip: float,
    limit: ArrayLike,
) -> StrainFriction:
    """Return sliders for these triangles; warp is as `yarns.thread_axes` says.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
        slip: Change of strain at which the sliders give way, positive.
        limit: Force per width at which they do, for warp, weft and shear [N/m], shape (3,); zero for no friction.
    """
    found = triangles(faces, rest)
    sliders, most = np.zeros((len(found.vertices), 3)), np.asarray(limit, dtype=np.float64)
    compliance = np.divide(slip, most, out=np.ones(3), where=most > 0.0)
    return StrainFriction(*found, sliders, compliance, most, 0.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def _extended(t, x, data):
    """Return by how much the springs of triangle t are extended, the slopes of the strains, and their frame."""
    fu, fv = deformed(t, x, data)
    strain, slopes, frame = thread_strains(fu, fv)
    return sub(strain, load(data.slider, t)), slopes, frame


@njit(cache=True, error_model="numpy", forceinline=True)
def _pull(extension, data):
    """Return the energy [J/m²] and the forces [N/m] of the springs."""
    energy_u, force_u = huber(extension[0], data.compliance[0], data.limit[0])
    energy_v, force_v = huber(extension[1], data.compliance[1], data.limit[1])
    energy_s, force_s = huber(extension[2], data.compliance[2], data.limit[2])
    return energy_u + energy_v + energy_s, (force_u, force_v, force_s)


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(t, x, start, inverse_mass, data, multipliers, h):
    extension, slopes, _ = _extended(t, x, data)
    soft = scaled((data.compliance[0], data.compliance[1], data.compliance[2], 0.0), 1.0 / (data.area[t] * h * h))
    high = scale(data.area[t] * h * h, (data.limit[0], data.limit[1], data.limit[2]))
    solve_bounded(t, x, start, inverse_mass, data, soft, multipliers, extension, slopes, h, scale(-1.0, high), high)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(t, x, data, forces):
    extension, slopes, _ = _extended(t, x, data)
    energy, force = _pull(extension, data)
    pull_u, pull_v = pulls(scale(-data.area[t], force), slopes)
    add_pulls(t, forces, data, pull_u, pull_v)
    return data.area[t] * energy


@njit(cache=True, error_model="numpy", forceinline=True)
def _secants(extension, data):
    """Return the compliance [m/N] of the springs as they are; 1 for those without friction, which have no force."""
    return (
        secant_compliance(extension[0], data.compliance[0], data.limit[0]) if data.limit[0] > 0.0 else 1.0,
        secant_compliance(extension[1], data.compliance[1], data.limit[1]) if data.limit[1] > 0.0 else 1.0,
        secant_compliance(extension[2], data.compliance[2], data.limit[2]) if data.limit[2] > 0.0 else 1.0,
        0.0,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(t, x, data, values, gradients, compliance):
    extension, slopes, _ = _extended(t, x, data)
    values[0], values[1], values[2] = extension
    fill_rows(t, data, slopes, scaled(_secants(extension, data), 1.0 / data.area[t]), gradients, compliance)
    for row in range(3):
        if data.limit[row] == 0.0:
            values[row] = 0.0
            gradients[row] = 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def _stiffness(t, x, data, material, stress, blocks):
    extension, slopes, frame = _extended(t, x, data)
    _, force = _pull(extension, data)
    soft = _secants(extension, data)
    over = material * data.area[t]
    stiff = (
        over / soft[0] if data.limit[0] > 0.0 else 0.0,
        over / soft[1] if data.limit[1] > 0.0 else 0.0,
        over / soft[2] if data.limit[2] > 0.0 else 0.0,
        0.0,
    )
    tension = thread_tension(scale(stress * data.area[t], force), slopes, frame)
    write_stiffness(t, data, stiff, slopes, tension, blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _slip(t, x, data):
    extension, _, _ = _extended(t, x, data)
    for row in range(3):
        data.slider[t, row] += slider_slip(extension[row], data.compliance[row], data.limit[row])


KIND = Kind(StrainFriction, 3, _project, _force, _linearise, None, _stiffness, _slip)
