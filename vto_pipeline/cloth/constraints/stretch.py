"""Membrane: an orthotropic sheet that resists warp, weft and shear strain, one block of three constraints a triangle.

Energy ½ A εᵀ K ε with the strains of `numerics.membrane` and the plane-stress stiffness K of the fabric [N/m]; its
compliance in XPBD is K⁻¹ / A (Macklin 2016, eq. 2). The three are solved together (a 3 x 3 system), so that warp,
weft and Poisson's coupling act at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.numerics.blocks import blocks
from vto_pipeline.numerics.membrane import deformation, on_corner, solve_symmetric, strains, thread_pulls
from vto_pipeline.numerics.vector import add, axpy, dot, load, store


class Stretch(NamedTuple):
    """Membrane constraints, in the order in which they are solved.

    Args:
        vertices: Corners of each triangle, shape (T, 3).
        gradients: Of the shape functions along (warp, weft), corner by corner [1/m], shape (T, 6).
        area: At rest [m²], shape (T,).
        compliance: K⁻¹ as (warp, weft, shear, warp-weft) [m/N].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    gradients: NDArray[np.float64]
    area: NDArray[np.float64]
    compliance: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def stretch(faces: NDArray[np.int32], rest: NDArray[np.float64], fabric: Fabric) -> Stretch:
    """Return the membrane of these triangles; warp runs along the vertical of the rest shape.

    Args:
        faces: Shape (F, 3). Triangles without area at rest carry nothing and are left out.
        rest: Rest positions [m], shape (V, 3).
        fabric: Stiffnesses.

    Raises:
        InputError: Poisson's ratio makes the sheet give energy away.
    """
    if fabric.poisson**2 * fabric.stretch_weft >= fabric.stretch_warp:
        raise InputError(
            f"fabric {fabric.name}: poisson {fabric.poisson} with warp {fabric.stretch_warp} and weft "
            f"{fabric.stretch_weft} N/m is not a stable material; wanted poisson² · weft < warp"
        )
    warp, weft, double_area = thread_axes(faces, rest)
    solid = double_area > 1e-12 * double_area.max(initial=0.0)
    faces, warp, weft, double_area = faces[solid], warp[solid], weft[solid], double_area[solid]
    a, b, c = rest[faces[:, 0]], rest[faces[:, 1]], rest[faces[:, 2]]
    gradients = np.empty((len(faces), 6))
    for k, (tail, head) in enumerate(((b, c), (c, a), (a, b))):
        edge_u, edge_v = _rows_dot(head - tail, warp), _rows_dot(head - tail, weft)
        gradients[:, 2 * k], gradients[:, 2 * k + 1] = -edge_v / double_area, edge_u / double_area
    arranged = blocks(faces, rest)
    return Stretch(
        np.ascontiguousarray(faces[arranged.order]),
        gradients[arranged.order],
        0.5 * double_area[arranged.order],
        np.array(
            [
                1.0 / fabric.stretch_warp,
                1.0 / fabric.stretch_weft,
                1.0 / fabric.shear,
                -fabric.poisson / fabric.stretch_warp,
            ]
        ),
        arranged.starts,
        arranged.colours,
    )


def thread_axes(
    faces: NDArray[np.int32], rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return unit warp and weft directions of each triangle, shape (F, 3) each, and twice its area [m²], shape (F,).

    Warp is the vertical (+Y) laid onto the triangle; where a triangle lies flat, front (+Z) takes its place.
    """
    normal = np.cross(rest[faces[:, 1]] - rest[faces[:, 0]], rest[faces[:, 2]] - rest[faces[:, 0]])
    double_area = np.linalg.norm(normal, axis=1)
    normal = np.divide(normal, double_area[:, None], out=np.zeros_like(normal), where=double_area[:, None] > 0)
    up = np.broadcast_to([0.0, 1.0, 0.0], normal.shape).copy()
    up[np.abs(normal[:, 1]) > 0.95] = (0.0, 0.0, 1.0)
    warp = up - _rows_dot(up, normal)[:, None] * normal
    warp /= np.linalg.norm(warp, axis=1, keepdims=True)
    return warp, np.cross(normal, warp), double_area


def _rows_dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->i", a, b)


@njit(cache=True, error_model="numpy")
def project_stretch(x, inverse_mass, data, multipliers, h_sq, threaded):
    """Solve each membrane block once, in order, in place.

    Args:
        x: Positions [m], shape (V, 3).
        inverse_mass: [1/kg], shape (V,); zero holds a vertex.
        data: The constraints.
        multipliers: λ [N·m·s²] so far in this step, shape (T, 3).
        h_sq: Step size squared [s²].
        threaded: Whether the blocks of a colour run in parallel.
    """
    for colour in range(len(data.colours) - 1):
        first, last = data.colours[colour], data.colours[colour + 1]
        if threaded:
            _project_parallel(x, inverse_mass, data, multipliers, h_sq, first, last)
        else:
            for block in range(first, last):
                _project_block(x, inverse_mass, data, multipliers, h_sq, block)


@njit(cache=True, error_model="numpy", parallel=True)
def _project_parallel(x, inverse_mass, data, multipliers, h_sq, first, last):
    for block in prange(first, last):
        _project_block(x, inverse_mass, data, multipliers, h_sq, block)


@njit(cache=True, error_model="numpy")
def _project_block(x, inverse_mass, data, multipliers, h_sq, block):
    s_uu, s_vv, s_ss, s_uv = data.compliance[0], data.compliance[1], data.compliance[2], data.compliance[3]
    for t in range(data.starts[block], data.starts[block + 1]):
        i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
        w0, w1, w2 = inverse_mass[i], inverse_mass[j], inverse_mass[k]
        g = data.gradients[t]
        x0, x1, x2 = load(x, i), load(x, j), load(x, k)
        fu, fv = deformation(x0, x1, x2, g)
        (cu, cv, cs), cosine, inverse, u, v, p, q = strains(fu, fv)
        iu, iv = inverse
        # the sums over corners of w ∇C ∇Cᵀ, written with a = Σ w gu², b = Σ w gu gv, c = Σ w gv²
        a = w0 * g[0] * g[0] + w1 * g[2] * g[2] + w2 * g[4] * g[4]
        b = w0 * g[0] * g[1] + w1 * g[2] * g[3] + w2 * g[4] * g[5]
        c = w0 * g[1] * g[1] + w1 * g[3] * g[3] + w2 * g[5] * g[5]
        # and u·v = sin γ, p·q = -sin γ, u·q = v·p = cos γ, u·p = v·q = 0
        sine = dot(u, v)
        soft = 1.0 / (data.area[t] * h_sq)
        l0, l1, l2 = multipliers[t, 0], multipliers[t, 1], multipliers[t, 2]
        shift = solve_symmetric(
            a + soft * s_uu,
            sine * b + soft * s_uv,
            cosine * b * iv,
            c + soft * s_vv,
            cosine * b * iu,
            a * iu * iu + c * iv * iv - 2.0 * sine * b * iu * iv + soft * s_ss,
            -cu - soft * (s_uu * l0 + s_uv * l1),
            -cv - soft * (s_uv * l0 + s_vv * l1),
            -cs - soft * s_ss * l2,
        )
        multipliers[t, 0], multipliers[t, 1], multipliers[t, 2] = l0 + shift[0], l1 + shift[1], l2 + shift[2]
        pull_u, pull_v = thread_pulls(shift, inverse, u, v, p, q)
        store(x, i, axpy(w0, on_corner(g[0], g[1], pull_u, pull_v), x0))
        store(x, j, axpy(w1, on_corner(g[2], g[3], pull_u, pull_v), x1))
        store(x, k, axpy(w2, on_corner(g[4], g[5], pull_u, pull_v), x2))


@njit(cache=True, error_model="numpy")
def add_stretch_forces(x, data, forces):
    """Add the membrane's forces [N] to `forces`, shape (V, 3), and return its energy [J]."""
    s_uu, s_vv, s_ss, s_uv = data.compliance[0], data.compliance[1], data.compliance[2], data.compliance[3]
    det = s_uu * s_vv - s_uv * s_uv
    energy = 0.0
    for t in range(len(data.vertices)):
        g = data.gradients[t]
        i, j, k = data.vertices[t, 0], data.vertices[t, 1], data.vertices[t, 2]
        fu, fv = deformation(load(x, i), load(x, j), load(x, k), g)
        (cu, cv, cs), _, inverse, u, v, p, q = strains(fu, fv)
        nu, nv, ns = (s_vv * cu - s_uv * cv) / det, (s_uu * cv - s_uv * cu) / det, cs / s_ss  # K ε
        area = data.area[t]
        energy += 0.5 * area * (nu * cu + nv * cv + ns * cs)
        pull_u, pull_v = thread_pulls((-area * nu, -area * nv, -area * ns), inverse, u, v, p, q)
        store(forces, i, add(on_corner(g[0], g[1], pull_u, pull_v), load(forces, i)))
        store(forces, j, add(on_corner(g[2], g[3], pull_u, pull_v), load(forces, j)))
        store(forces, k, add(on_corner(g[4], g[5], pull_u, pull_v), load(forces, k)))
    return energy
