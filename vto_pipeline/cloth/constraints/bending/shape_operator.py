"""Bending that converges on any mesh: the curvature of each triangle, from the slopes across its edges.

The shape operator of a triangle is (1/A) Σ l φ n nᵀ over its edges, with the edge's length l, outward normal n in the
triangle's plane, and the turn φ of the surface normal from the triangle to the middle of the edge (Grinspun, Gingold,
Reisman & Zorin 2006, section 4). φ comes from the hinge angles as `mid_edge` says, so the stencil has twelve vertices:
the triangle, its three neighbours, and theirs. At a free edge, φ is what costs least. The energy is ½ A κᵀ D κ with
κ = (κ_warp, κ_weft, 2 κ_twist) less what it is at rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bending.hinge import hinge_angles
from vto_pipeline.cloth.constraints.bending.mid_edge import slope_shares
from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.cloth.constraints.membrane.slivers import SLIVER, slenderness
from vto_pipeline.cloth.constraints.membrane.yarns import thread_axes
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import corners_from, opposite_half_edges
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.bending import dihedral
from vto_pipeline.numerics.mechanics.membrane import solve_symmetric
from vto_pipeline.numerics.vector import axpy, dot, load, store, sub

_SOFTEST = 1e-3  # of the stiffer direction: a fabric without any stiffness in one has no compliance

# corners 0 1 2; across edge k (corner k to k + 1) vertex 3 + k; across that neighbour's other edges 6 + 2k and 7 + 2k
HINGES = np.array(
    [[k, (k + 1) % 3, (k + 2) % 3, 3 + k] for k in range(3)]
    + [hinge for k in range(3) for hinge in ([k, 3 + k, (k + 1) % 3, 6 + 2 * k], [3 + k, (k + 1) % 3, k, 7 + 2 * k])],
    np.int32,
)
"""Ends and wings of the nine hinges of a stencil, shape (9, 4)."""


class ShapeOperator(NamedTuple):
    """Curvature constraints, in the order in which they are solved.

    Args:
        vertices: See `HINGES`, shape (T, 12); where the cloth ends, a corner of the triangle, without weight.
        weights: Curvature (warp, weft, twice the twist) per angle of each hinge [1/m], shape (T, 3, 9).
        rest: Angles at rest [rad], shape (T, 9).
        area: At rest [m²], shape (T,).
        compliance: D⁻¹ as (warp, weft, twist, warp-weft) [1/(N·m)].
        damping: Rayleigh's β, loss in proportion to stiffness [s].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    weights: NDArray[np.float64]
    rest: NDArray[np.float64]
    area: NDArray[np.float64]
    compliance: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def shape_operator(
    mesh: TriangleMesh,
    rest: RestShape,
    fabric: Fabric,
    *,
    held: NDArray[np.int64] | tuple[int, ...] = (),
    poisson: float = 0.0,
    damping: float = 0.0,
) -> ShapeOperator:
    """Return the curvature constraints of a sheet.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Bending rigidities, those of a strip whose edges are free. The twist has the stiffness of an isotropic
            plate of rigidity √(B_warp B_weft).
        held: Vertices held where they are. A triangle of three does not bend, and a clamp is where it ends: half of
            a hinge that bends for a whole one costs a cantilever two edge lengths of its accuracy.
        poisson: Poisson's ratio of bending, the geometric mean of both directions.
        damping: Rayleigh's β [s].

    Raises:
        InputError: Poisson's ratio is not that of a stable material.
    """
    if not -1.0 < poisson < 1.0:
        raise InputError(f"Poisson's ratio of bending is {poisson}; expected -1 to 1")
    faces = mesh.faces
    corners = rest.corners(faces)
    warp, weft, double_area = thread_axes(corners)
    clamped = np.asarray(np.isin(faces, np.asarray(held, dtype=np.int64)).all(axis=1))
    sliver = np.asarray(slenderness(corners) <= SLIVER)
    opposite = _bending_edges(mesh, sliver)
    vertices = _stencils(faces, opposite)
    compliance = _compliance(fabric, poisson)
    weights = _weights(corners, opposite, warp, weft, 0.5 * double_area, clamped, compliance)
    resists = max(fabric.bending_warp, fabric.bending_weft) > 0.0
    kept = ~(sliver | clamped) & (weights != 0.0).any(axis=(1, 2)) & resists
    vertices, weights, area = vertices[kept], weights[kept], 0.5 * double_area[kept]
    order, starts, colours = blocks(vertices, rest.positions)
    vertices, weights = np.ascontiguousarray(vertices[order]), np.ascontiguousarray(weights[order])
    area, angles = area[order], np.zeros((len(vertices), 9))
    if rest.rest_angles:
        angles = hinge_angles(rest.positions, vertices[:, HINGES].reshape(-1, 4)).reshape(-1, 9)
    return ShapeOperator(vertices, weights, angles, area, compliance, damping, starts, colours)


def rigidity(compliance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return D [N·m], shape (3, 3)."""
    warp, weft, twist, cross = compliance
    return np.linalg.inv(np.array([[warp, cross, 0.0], [cross, weft, 0.0], [0.0, 0.0, twist]]))


def _compliance(fabric: Fabric, poisson: float) -> NDArray[np.float64]:
    """Return D⁻¹ as (warp, weft, twist, warp-weft), so that a strip with free edges has the fabric's rigidity."""
    largest = max(fabric.bending_warp, fabric.bending_weft)
    least = _SOFTEST * largest if largest > 0.0 else 1.0  # of what does not resist, no triangle is kept
    warp, weft = max(fabric.bending_warp, least), max(fabric.bending_weft, least)
    mean = np.sqrt(warp * weft)
    return np.array([1.0 / warp, 1.0 / weft, 2.0 * (1.0 + poisson) / mean, -poisson / mean])


def _bending_edges(mesh: TriangleMesh, sliver: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return the opposite of each half-edge, shape (F, 3); -1 at a border or beside a sliver."""
    opposite = opposite_half_edges(mesh)
    across = np.where(opposite >= 0, opposite // 3, 0)
    void = sliver[across] | np.repeat(sliver, 3)
    return np.where(void, -1, opposite).reshape(-1, 3).astype(np.int32)


def _apex(faces: NDArray[np.int32], half: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the corner opposite each half-edge, -1 for none."""
    corner = faces.reshape(-1)[3 * (half // 3) + (half + 2) % 3]
    return np.where(half >= 0, corner, -1).astype(np.int32)


def _stencils(faces: NDArray[np.int32], opposite: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the twelve vertices of each face, shape (F, 12); corner 0 where there is none."""
    vertices = np.repeat(faces[:, :1], 12, axis=1)
    vertices[:, :3] = faces
    flat_opposite = opposite.reshape(-1)
    for k in range(3):
        half = opposite[:, k]
        found = [half]
        for turn in (1, 2):
            around = 3 * (half // 3) + (half + turn) % 3
            found.append(np.where(half >= 0, flat_opposite[around], -1))
        for slot, one in zip((3 + k, 6 + 2 * k, 7 + 2 * k), found, strict=True):
            apex = _apex(faces, one)
            vertices[:, slot] = np.where(apex >= 0, apex, faces[:, 0])
    return vertices


def _weights(
    corners: NDArray[np.float64],
    opposite: NDArray[np.int32],
    warp: NDArray[np.float64],
    weft: NDArray[np.float64],
    area: NDArray[np.float64],
    clamped: NDArray[np.bool_],
    compliance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the curvature of each face, of rest corners (F, 3, 3), per angle of each hinge, shape (F, 3, 9)."""
    bends = np.where((opposite >= 0) & clamped[opposite // 3], -1, opposite)  # what bends on both sides
    weights = np.zeros((len(corners), 3, 9))
    normals = np.zeros((len(corners), 3, 3))
    for k in range(3):
        along = corners[:, (k + 1) % 3] - corners[:, k]
        u, v = np.einsum("ij,ij->i", along, warp), np.einsum("ij,ij->i", along, weft)
        length = np.hypot(u, v)
        tensor = np.column_stack([v * v, u * u, -2.0 * u * v])  # l² n nᵀ, n = (v, -u) / l
        np.divide(tensor, (length * area)[:, None], out=normals[:, k], where=area[:, None] > 0.0)
        half = opposite[:, k]
        both = bends[:, k] >= 0
        weights[(half >= 0) & ~both, :, k] += normals[(half >= 0) & ~both, k]  # beside a clamp: its own slope
        here = np.flatnonzero(both & ~clamped)
        shares = _shares(corners, bends, here, k)
        other = np.array([k, (k + 1) % 3, (k + 2) % 3, 3 + 2 * k, 4 + 2 * k])
        for share, slot in zip(shares.T, other, strict=True):
            weights[here, :, slot] += share[:, None] * normals[here, k]
    return _free_edges(weights, normals, opposite < 0, compliance)


def _shares(
    corners: NDArray[np.float64], bends: NDArray[np.int32], here: NDArray[np.int64], k: int
) -> NDArray[np.float64]:
    """Return the shares of edge k of these faces; see `slope_shares`."""
    half = bends[here, k]
    turned = corners[here][:, [k, (k + 1) % 3, (k + 2) % 3]]
    flat = bends.reshape(-1)
    across = [
        half,
        bends[here, (k + 1) % 3],
        bends[here, (k + 2) % 3],
        flat[3 * (half // 3) + (half + 1) % 3],
        flat[3 * (half // 3) + (half + 2) % 3],
    ]
    found = np.stack(across, axis=1)
    beyond = corners.reshape(-1, 3)[corners_from(np.maximum(found, 0))]
    return slope_shares(turned, np.where((found >= 0)[:, :, None, None], beyond, np.nan))


def _free_edges(
    weights: NDArray[np.float64],
    normals: NDArray[np.float64],
    free: NDArray[np.bool_],
    compliance: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the weights with the slope at free edges such that the triangle's energy is least: no moment there."""
    factor = np.linalg.cholesky(rigidity(compliance))
    for face in np.flatnonzero(free.any(axis=1) & (weights != 0.0).any(axis=(1, 2))):
        spanned, _ = np.linalg.qr(factor.T @ normals[face, free[face]].T)
        stressed = factor.T @ weights[face]
        weights[face] = np.linalg.solve(factor.T, stressed - spanned @ (spanned.T @ stressed))
    return weights


@njit(cache=True, error_model="numpy")
def _curvature(i, x, data, gradients):
    """Return by how much a stencil is curved beyond rest and fill the gradients, shape (3, 12, 3)."""
    vertices, weights = data.vertices, data.weights
    warp = weft = twist = 0.0
    gradients[:] = 0.0
    for hinge in range(9):
        w0, w1, w2 = weights[i, 0, hinge], weights[i, 1, hinge], weights[i, 2, hinge]
        if w0 == 0.0 and w1 == 0.0 and w2 == 0.0:
            continue
        a, b, c, d = HINGES[hinge, 0], HINGES[hinge, 1], HINGES[hinge, 2], HINGES[hinge, 3]
        angle, ga, gb, gc, gd = dihedral(
            load(x, vertices[i, a]), load(x, vertices[i, b]), load(x, vertices[i, c]), load(x, vertices[i, d])
        )
        angle -= data.rest[i, hinge]
        warp, weft, twist = warp + w0 * angle, weft + w1 * angle, twist + w2 * angle
        for row in range(3):
            weight = weights[i, row, hinge]
            store(gradients[row], a, axpy(weight, ga, load(gradients[row], a)))
            store(gradients[row], b, axpy(weight, gb, load(gradients[row], b)))
            store(gradients[row], c, axpy(weight, gc, load(gradients[row], c)))
            store(gradients[row], d, axpy(weight, gd, load(gradients[row], d)))
    return warp, weft, twist


@njit(cache=True, error_model="numpy")
def _project(i, x, start, inverse_mass, data, multipliers, h):
    gradients = np.empty((3, 12, 3))
    bent = _curvature(i, x, data, gradients)
    gram, change = np.zeros((3, 3)), np.zeros(3)
    viscous = data.damping / h
    for s in range(12):
        v = data.vertices[i, s]
        moved = sub(load(x, v), load(start, v))
        for a in range(3):
            ga = load(gradients[a], s)
            change[a] += dot(ga, moved)
            for b in range(3):
                gram[a, b] += (1.0 + viscous) * inverse_mass[v] * dot(ga, load(gradients[b], s))
    soft = 1.0 / (data.area[i] * h * h)
    warp, weft, twist = soft * data.compliance[0], soft * data.compliance[1], soft * data.compliance[2]
    cross = soft * data.compliance[3]
    l0, l1, l2 = multipliers[i, 0], multipliers[i, 1], multipliers[i, 2]
    shift = solve_symmetric(
        gram[0, 0] + warp,
        gram[0, 1] + cross,
        gram[0, 2],
        gram[1, 1] + weft,
        gram[1, 2],
        gram[2, 2] + twist,
        -bent[0] - warp * l0 - cross * l1 - viscous * change[0],
        -bent[1] - cross * l0 - weft * l1 - viscous * change[1],
        -bent[2] - twist * l2 - viscous * change[2],
    )
    multipliers[i, 0], multipliers[i, 1], multipliers[i, 2] = l0 + shift[0], l1 + shift[1], l2 + shift[2]
    for s in range(12):
        v = data.vertices[i, s]
        if inverse_mass[v] > 0.0:
            for row in range(3):
                store(x, v, axpy(inverse_mass[v] * shift[row], load(gradients[row], s), load(x, v)))


@njit(cache=True, error_model="numpy")
def _force(i, x, data, forces):
    gradients = np.empty((3, 12, 3))
    bent = _curvature(i, x, data, gradients)
    moment = _moment(bent, data.compliance)
    for s in range(12):
        v = data.vertices[i, s]
        for row in range(3):
            store(forces, v, axpy(-data.area[i] * moment[row], load(gradients[row], s), load(forces, v)))
    return 0.5 * data.area[i] * dot(moment, bent)


@njit(cache=True, error_model="numpy")
def _moment(bent, compliance):
    """Return D κ [N]."""
    warp, weft, twist, cross = compliance[0], compliance[1], compliance[2], compliance[3]
    det = warp * weft - cross * cross
    return (weft * bent[0] - cross * bent[1]) / det, (warp * bent[1] - cross * bent[0]) / det, bent[2] / twist


@njit(cache=True, error_model="numpy")
def _linearise(i, x, data, values, gradients, compliance):
    values[0], values[1], values[2] = _curvature(i, x, data, gradients)
    soft = 1.0 / data.area[i]
    compliance[:] = 0.0
    compliance[0, 0], compliance[1, 1] = soft * data.compliance[0], soft * data.compliance[1]
    compliance[2, 2] = soft * data.compliance[2]
    compliance[0, 1] = compliance[1, 0] = soft * data.compliance[3]


@njit(cache=True, error_model="numpy")
def _geometric(i, x, data, blocks):
    """Nothing: the second derivative of the angles is indefinite, and small beside the material's share."""


KIND = Kind(ShapeOperator, 3, _project, _force, _linearise, _geometric)
