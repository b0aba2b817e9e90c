"""Shared parts of constraints on triangle strain: their arrays, and one step on a triangle.

A kind brings a measure of strain of `numerics.membrane` and a law; its data have `vertices`, `gradients`, `area`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.membrane.slivers import SLIVER, slenderness
from vto_pipeline.cloth.constraints.membrane.yarns import thread_axes
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.membrane import (
    corner_force,
    deformation,
    mobility,
    pulls,
    solve_symmetric,
    strain_changes,
)
from vto_pipeline.numerics.mechanics.tension import tension_pulls
from vto_pipeline.numerics.mechanics.xpbd_row import bounded_step
from vto_pipeline.numerics.vector import add, axpy, load, scale, store, store_at, sub


class Triangles(NamedTuple):
    """Triangles of a sheet in the order in which they are solved.

    Args:
        vertices: Corners of each triangle, shape (T, 3).
        gradients: Of the shape functions along (warp, weft), corner by corner [1/m], shape (T, 6).
        area: At rest [m²], shape (T,).
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def triangles(faces: NDArray[np.int32], rest: RestShape) -> Triangles:
    """Return these triangles, laid out along their threads; those without area at rest carry nothing and are left out.

    Args:
        faces: Shape (F, 3).
        rest: Their shape without forces.
    """
    corners = rest.corners(faces)
    warp, weft, double_area = thread_axes(corners)
    solid = double_area > 1e-12 * double_area.max(initial=0.0)
    faces, corners = faces[solid], corners[solid]
    warp, weft, double_area = warp[solid], weft[solid], double_area[solid]
    a, b, c = corners.transpose(1, 0, 2)
    gradients = np.empty((len(faces), 6))
    for k, (tail, head) in enumerate(((b, c), (c, a), (a, b))):
        edge_u, edge_v = np.einsum("ij,ij->i", head - tail, warp), np.einsum("ij,ij->i", head - tail, weft)
        gradients[:, 2 * k], gradients[:, 2 * k + 1] = -edge_v / double_area, edge_u / double_area
    area = 0.5 * double_area * np.minimum(1.0, slenderness(corners) / SLIVER)
    order, starts, colours = blocks(faces, rest.positions)
    return Triangles(np.ascontiguousarray(faces[order]), gradients[order], area[order], starts, colours)


@njit(cache=True, error_model="numpy", inline="always")
def shape_gradients(t, data):
    """Return the shape gradients of triangle t as a tuple: a view of the array would count references, which costs."""
    g = data.gradients
    return g[t, 0], g[t, 1], g[t, 2], g[t, 3], g[t, 4], g[t, 5]


@njit(cache=True, error_model="numpy", inline="always")
def deformed(t, x, data):
    """Return F_u and F_v of triangle t."""
    i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
    return deformation(load(x, i), load(x, j), load(x, k), shape_gradients(t, data))


@njit(cache=True, error_model="numpy", inline="always")
def add_pulls(t, x, data, pull_u, pull_v):
    """Add to row i of x, shape (V, 3), what pulls on F_u and F_v do to corner i of triangle t."""
    i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
    g = shape_gradients(t, data)
    store(x, i, add(corner_force(g[0], g[1], pull_u, pull_v), load(x, i)))
    store(x, j, add(corner_force(g[2], g[3], pull_u, pull_v), load(x, j)))
    store(x, k, add(corner_force(g[4], g[5], pull_u, pull_v), load(x, k)))


@njit(cache=True, error_model="numpy", inline="always")
def xpbd_strain_system(t, x, start, inverse_mass, data, soft, lambdas, values, slopes, h):
    """Return the XPBD system of three strains: its matrix, upper triangle by rows, and its right-hand side.

    Macklin et al. 2016, eq. 26, with the damping γ = β / h, for three rows at once: (1 + γ) ∇C W ∇Cᵀ + α̃ and
    -C - α̃ λ - γ ∇C (x - xⁿ).

    Args:
        soft: α̃ = α / h², as (warp, weft, shear, warp-weft).
        lambdas: λ so far in this step.
        values: C.
        slopes: Of the strains.
    """
    i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
    g = shape_gradients(t, data)
    s_uu, s_vv, s_ss, s_uv = soft
    ru = -values[0] - s_uu * lambdas[0] - s_uv * lambdas[1]
    rv = -values[1] - s_uv * lambdas[0] - s_vv * lambdas[1]
    rs = -values[2] - s_ss * lambdas[2]
    uu, uv, us, vv, vs, ss = mobility(slopes, inverse_mass[i], inverse_mass[j], inverse_mass[k], g)
    damped = 1.0
    if data.damping > 0.0:
        viscous = data.damping / h
        damped += viscous
        moved_i, moved_j = sub(load(x, i), load(start, i)), sub(load(x, j), load(start, j))
        du, dv = deformation(moved_i, moved_j, sub(load(x, k), load(start, k)), g)
        change = strain_changes(slopes, du, dv)
        ru, rv, rs = ru - viscous * change[0], rv - viscous * change[1], rs - viscous * change[2]
    matrix = (
        damped * uu + s_uu,
        damped * uv + s_uv,
        damped * us,
        damped * vv + s_vv,
        damped * vs,
        damped * ss + s_ss,
    )
    return matrix, (ru, rv, rs)


@njit(cache=True, error_model="numpy", inline="always")
def apply_strain_multipliers(t, x, inverse_mass, data, slopes, shift):
    """Move the corners of triangle t by W ∇Cᵀ Δλ."""
    i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
    g = shape_gradients(t, data)
    pull_u, pull_v = pulls(shift, slopes)
    store(x, i, axpy(inverse_mass[i], corner_force(g[0], g[1], pull_u, pull_v), load(x, i)))
    store(x, j, axpy(inverse_mass[j], corner_force(g[2], g[3], pull_u, pull_v), load(x, j)))
    store(x, k, axpy(inverse_mass[k], corner_force(g[4], g[5], pull_u, pull_v), load(x, k)))


@njit(cache=True, error_model="numpy", inline="always")
def solve_strains(t, x, start, inverse_mass, data, soft, multipliers, values, slopes, h):
    """Do one XPBD step on the three strains together, in place; see `xpbd_strain_system`."""
    lambdas = load(multipliers, t)
    matrix, right = xpbd_strain_system(t, x, start, inverse_mass, data, soft, lambdas, values, slopes, h)
    shift = solve_symmetric(*matrix, *right)
    store(multipliers, t, add(lambdas, shift))
    apply_strain_multipliers(t, x, inverse_mass, data, slopes, shift)


@njit(cache=True, error_model="numpy", inline="always")
def solve_bounded(t, x, start, inverse_mass, data, soft, multipliers, values, slopes, h, low, high):
    """Do one XPBD step on the three strains in turn, with λ kept between low and high; as `xpbd_strain_system`.

    For a coupling of the rows by `soft` there is no use: only its first three count.
    """
    l0, l1, l2 = load(multipliers, t)
    matrix, right = xpbd_strain_system(t, x, start, inverse_mass, data, soft, (l0, l1, l2), values, slopes, h)
    d0 = bounded_step(matrix[0], right[0], l0, low[0], high[0])
    d1 = bounded_step(matrix[3], right[1] - matrix[1] * d0, l1, low[1], high[1])
    d2 = bounded_step(matrix[5], right[2] - matrix[2] * d0 - matrix[4] * d1, l2, low[2], high[2])
    store(multipliers, t, (l0 + d0, l1 + d1, l2 + d2))
    apply_strain_multipliers(t, x, inverse_mass, data, slopes, (d0, d1, d2))


@njit(cache=True, error_model="numpy", inline="always")
def fill_rows(t, data, slopes, soft, gradients, compliance):
    """Write the gradients of the three strains, shape (3, 3, 3): strain, corner, axis; and their compliance, (3, 3)."""
    for corner in range(3):
        du, dv = data.gradients[t, 2 * corner], data.gradients[t, 2 * corner + 1]
        store_at(gradients, 0, corner, scale(du, slopes[0]))
        store_at(gradients, 1, corner, scale(dv, slopes[1]))
        store_at(gradients, 2, corner, corner_force(du, dv, slopes[2], slopes[3]))
    compliance[0, 0], compliance[1, 1], compliance[2, 2] = soft[0], soft[1], soft[2]
    compliance[0, 1] = compliance[1, 0] = soft[3]
    compliance[0, 2] = compliance[2, 0] = compliance[1, 2] = compliance[2, 1] = 0.0


@njit(cache=True, error_model="numpy", inline="always")
def write_stiffness(t, data, stiff, slopes, tension, blocks):
    """Write the stiffness of triangle t, shape (3, 3, 3, 3): corner, corner, axis, axis.

    Args:
        stiff: Tangent stiffness (warp, weft, shear, warp-weft), times the area [N·m].
        slopes: Of the strains.
        tension: What stress adds; see `numerics.tension`.
    """
    g = data.gradients
    for j in range(3):
        du, dv = g[t, 2 * j], g[t, 2 * j + 1]
        for m in range(3):
            warp, weft = du * slopes[0][m], dv * slopes[1][m]
            shear = stiff[2] * (du * slopes[2][m] + dv * slopes[3][m])
            strained_u, strained_v = pulls(
                (stiff[0] * warp + stiff[3] * weft, stiff[1] * weft + stiff[3] * warp, shear), slopes
            )
            turned_u, turned_v = tension_pulls(tension, du, dv, m)
            pull_u, pull_v = add(strained_u, turned_u), add(strained_v, turned_v)
            for i in range(3):
                pull = corner_force(g[t, 2 * i], g[t, 2 * i + 1], pull_u, pull_v)
                blocks[j, i, m, 0], blocks[j, i, m, 1], blocks[j, i, m, 2] = pull
