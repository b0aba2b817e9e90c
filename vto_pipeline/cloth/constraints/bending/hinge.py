"""Bending: one constraint a hinge, the dihedral angle against its rest angle.

Energy ½ B (l²/A) (θ - θ₀)² with the bending rigidity B [N·m], the hinge's length l and the area A of its two
triangles. Grinspun et al. 2003 and Bergou et al. 2006 give the weight 3 l²/A up to the material's constant; B is a
rigidity per width, and one third of that weight makes the energy of a bent strip ½ B κ² per area: exactly so on a
grid that follows the bend, where one hinge in three turns, and within some per cent on an isotropic mesh.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.kind import Kind
from vto_pipeline.cloth.constraints.membrane.slivers import SLIVER, slenderness
from vto_pipeline.cloth.constraints.membrane.yarns import thread_axes
from vto_pipeline.geometry.topology import corners_from, hinge_halves, hinges
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.linear.coloured_blocks import blocks
from vto_pipeline.numerics.mechanics.bending import add_dihedral_hessian, dihedral
from vto_pipeline.numerics.mechanics.xpbd_row import multiplier_step
from vto_pipeline.numerics.vector import axpy, dot, load, store, store_at, sub


class Bend(NamedTuple):
    """Hinge constraints, in the order in which they are solved.

    Args:
        vertices: Ends of the hinge, then the wings, shape (H, 4).
        rest: Rest angle [rad], shape (H,).
        compliance: [1/(N·m)], shape (H,).
        damping: Rayleigh's β, loss in proportion to stiffness [s].
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    rest: NDArray[np.float64]
    compliance: NDArray[np.float64]
    damping: float
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


class Hinges(NamedTuple):
    """Hinges of a sheet whose two triangles have areas at rest.

    Args:
        vertices: Ends, then the wings, shape (H, 4).
        length: [m], shape (H,).
        area: Of both triangles [m²], shape (H,).
        along_warp: Squared cosine of the angle between hinge and warp, in the first triangle, shape (H,).
        angle: At rest [rad], shape (H,).
        corners: Ends and wing of either triangle at rest [m], shape (H, 2, 3, 3). Across a seam, each in its own panel.
    """

    vertices: NDArray[np.int32]
    length: NDArray[np.float64]
    area: NDArray[np.float64]
    along_warp: NDArray[np.float64]
    angle: NDArray[np.float64]
    corners: NDArray[np.float64]

    def stiffness(self, fabric: Fabric) -> NDArray[np.float64]:
        """Return B l²/A [N·m], shape (H,): across a hinge at angle φ to the warp, B = B_warp sin²φ + B_weft cos²φ."""
        rigidity = fabric.bending_warp * (1.0 - self.along_warp) + fabric.bending_weft * self.along_warp
        stiff: NDArray[np.float64] = rigidity * self.length**2 / self.area
        return stiff


def solid_hinges(mesh: TriangleMesh, rest: RestShape) -> Hinges:
    """Return the hinges that can bend.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
    """
    halves = hinge_halves(mesh)
    laid = rest.corners(mesh.faces).reshape(-1, 3)
    one, other = laid[corners_from(halves[:, 0])], laid[corners_from(halves[:, 1])]
    edge, opposed = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0]
    length_sq = 0.5 * (np.einsum("ij,ij->i", edge, edge) + np.einsum("ij,ij->i", opposed, opposed))
    warp, _, area_one = thread_axes(one)
    _, _, area_other = thread_axes(other)
    area = 0.5 * (area_one + area_other)
    solid = (np.minimum(slenderness(one), slenderness(other)) > SLIVER) & (length_sq > 0.0)
    along = np.einsum("ij,ij->i", edge, warp)[solid] ** 2 / np.einsum("ij,ij->i", edge, edge)[solid]
    found = hinges(mesh)[solid]
    angle = hinge_angles(rest.positions, found) if rest.rest_angles else np.zeros(len(found))
    both = np.stack([one[solid], other[solid][:, [1, 0, 2]]], axis=1)
    return Hinges(found, np.sqrt(length_sq[solid]), area[solid], along, angle, both)


def bend(mesh: TriangleMesh, rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Bend:
    """Return the hinges of a sheet; those that do not resist bending are left out.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Bending rigidities.
        damping: Rayleigh's β [s].
    """
    found = solid_hinges(mesh, rest)
    stiffness = found.stiffness(fabric)
    stiff = stiffness > 0.0
    order, starts, colours = blocks(found.vertices[stiff], rest.positions)
    vertices = np.ascontiguousarray(found.vertices[stiff][order])
    return Bend(vertices, found.angle[stiff][order], 1.0 / stiffness[stiff][order], damping, starts, colours)


@njit(cache=True, error_model="numpy")
def hinge_angles(x, hinges):
    """Return the angles of hinges [rad], shape (H,), at positions x [m], shape (V, 3)."""
    angles = np.empty(len(hinges))
    for i in range(len(hinges)):
        a, b, c, d = hinges[i, 0], hinges[i, 1], hinges[i, 2], hinges[i, 3]
        angles[i] = dihedral(load(x, a), load(x, b), load(x, c), load(x, d))[0]
    return angles


@njit(cache=True, error_model="numpy", forceinline=True)
def hinge_angle_gradients(i, x, data):
    """Return the angle of hinge i and its gradients."""
    a, b, c, d = data.vertices[i, 0], data.vertices[i, 1], data.vertices[i, 2], data.vertices[i, 3]
    angle, ga, gb, gc, gd = dihedral(load(x, a), load(x, b), load(x, c), load(x, d))
    return angle, (ga, gb, gc, gd)


@njit(cache=True, error_model="numpy", forceinline=True)
def hinge_mobility(i, inverse_mass, data, slopes):
    """Return ∇θ W ∇θᵀ."""
    weight = 0.0
    for s in range(4):
        weight += inverse_mass[data.vertices[i, s]] * dot(slopes[s], slopes[s])
    return weight


@njit(cache=True, error_model="numpy", forceinline=True)
def hinge_angle_change(i, x, start, data, slopes):
    """Return ∇θ·(x - xⁿ)."""
    change = 0.0
    for s in range(4):
        v = data.vertices[i, s]
        change += dot(slopes[s], sub(load(x, v), load(start, v)))
    return change


@njit(cache=True, error_model="numpy", forceinline=True)
def apply_hinge_multiplier(i, x, inverse_mass, data, slopes, shift):
    """Move the vertices of hinge i by W ∇θᵀ Δλ."""
    for s in range(4):
        v = data.vertices[i, s]
        store(x, v, axpy(shift * inverse_mass[v], slopes[s], load(x, v)))


@njit(cache=True, error_model="numpy", forceinline=True)
def add_moment(i, data, slopes, moment, forces):
    """Add what a moment [N·m] that opens hinge i does to its vertices."""
    for s in range(4):
        v = data.vertices[i, s]
        store(forces, v, axpy(moment, slopes[s], load(forces, v)))


@njit(cache=True, error_model="numpy", forceinline=True)
def _project(i, x, start, inverse_mass, data, multipliers, h):
    angle, slopes = hinge_angle_gradients(i, x, data)
    weight = hinge_mobility(i, inverse_mass, data, slopes)
    if weight == 0.0:
        return
    change = hinge_angle_change(i, x, start, data, slopes) if data.damping > 0.0 else 0.0
    soft, viscous = data.compliance[i] / (h * h), data.damping / h
    shift = multiplier_step(angle - data.rest[i], weight, soft, multipliers[i, 0], change, viscous)
    multipliers[i, 0] += shift
    apply_hinge_multiplier(i, x, inverse_mass, data, slopes, shift)


@njit(cache=True, error_model="numpy", forceinline=True)
def _force(i, x, data, forces):
    angle, slopes = hinge_angle_gradients(i, x, data)
    moment = -(angle - data.rest[i]) / data.compliance[i]
    add_moment(i, data, slopes, moment, forces)
    return -0.5 * moment * (angle - data.rest[i])


@njit(cache=True, error_model="numpy", forceinline=True)
def _linearise(i, x, data, values, gradients, compliance):
    angle, slopes = hinge_angle_gradients(i, x, data)
    values[0] = angle - data.rest[i]
    for s in range(4):
        store_at(gradients, 0, s, slopes[s])
    compliance[0, 0] = data.compliance[i]


@njit(cache=True, error_model="numpy", forceinline=True)
def write_hinge_stiffness(i, x, data, slopes, stiffness, moment, blocks):
    """Write stiffness ∇θ ∇θᵀ + moment ∇²θ of hinge i [N/m] into blocks, shape (4, 4, 3, 3)."""
    for a in range(4):
        for b in range(4):
            for k in range(3):
                for m in range(3):
                    blocks[a, b, k, m] = stiffness * slopes[a][k] * slopes[b][m]
    a, b, c, d = data.vertices[i, 0], data.vertices[i, 1], data.vertices[i, 2], data.vertices[i, 3]
    add_dihedral_hessian(moment, load(x, a), load(x, b), load(x, c), load(x, d), blocks)


@njit(cache=True, error_model="numpy", forceinline=True)
def _exact(i, x, data, material, blocks):
    angle, slopes = hinge_angle_gradients(i, x, data)
    stiffness = 1.0 / data.compliance[i]
    moment = stiffness * (angle - data.rest[i])
    write_hinge_stiffness(i, x, data, slopes, material * stiffness, moment, blocks)


# None for what stress adds as a rule: the second derivative of the angle is indefinite.
KIND = Kind(Bend, 1, _project, _force, _linearise, None, exact=_exact)
