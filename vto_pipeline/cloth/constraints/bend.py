"""Bending: one constraint a hinge, the dihedral angle against its rest angle.

Energy ½ B (l²/A) (θ - θ₀)² with the bending rigidity B [N·m], the hinge's length l and the area A of its two
triangles. Grinspun et al. 2003 and Bergou et al. 2006 give the weight 3 l²/A up to the material's constant; B is a
rigidity per width, and one third of that weight makes the energy of a bent strip ½ B κ² per area: exactly so on a
grid that follows the bend, where one hinge in three turns, and within some per cent on an isotropic mesh.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.stretch import thread_axes
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.numerics.bending import dihedral
from vto_pipeline.numerics.blocks import blocks
from vto_pipeline.numerics.vector import axpy, dot, load, store


class Bend(NamedTuple):
    """Hinge constraints, in the order in which they are solved.

    Args:
        vertices: Ends of the hinge, then the wings, shape (H, 4).
        rest: Rest angle [rad], shape (H,).
        compliance: [1/(N·m)], shape (H,).
        starts, colours: See `numerics.blocks.Blocks`.
    """

    vertices: NDArray[np.int32]
    rest: NDArray[np.float64]
    compliance: NDArray[np.float64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def bend(hinges: NDArray[np.int32], rest: NDArray[np.float64], rest_angles: bool, fabric: Fabric) -> Bend:
    """Return the hinges of a sheet.

    Args:
        hinges: Ends and wings as from `geometry.topology.hinges`, shape (H, 4). None when the fabric does not resist
            bending.
        rest: Rest positions [m], shape (V, 3).
        rest_angles: Keep the angles of `rest`; else the sheet is flat at rest.
        fabric: Bending rigidities. Across a hinge at angle φ to the warp, B = B_warp sin²φ + B_weft cos²φ.
    """
    edge = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    length_sq = np.einsum("ij,ij->i", edge, edge)
    warp, _, area_one = thread_axes(hinges[:, [0, 1, 2]], rest)
    _, _, area_other = thread_axes(hinges[:, [1, 0, 3]], rest)
    area = 0.5 * (area_one + area_other)
    solid = (np.minimum(area_one, area_other) > 1e-12 * area.max(initial=0.0)) & (length_sq > 0.0)
    hinges, edge, length_sq, warp, area = hinges[solid], edge[solid], length_sq[solid], warp[solid], area[solid]
    cos_sq = np.einsum("ij,ij->i", edge, warp) ** 2 / length_sq
    rigidity = fabric.bending_warp * (1.0 - cos_sq) + fabric.bending_weft * cos_sq
    stiff = rigidity > 0.0
    hinges, length_sq, area, rigidity = hinges[stiff], length_sq[stiff], area[stiff], rigidity[stiff]
    order, starts, colours = blocks(hinges, rest)
    vertices = np.ascontiguousarray(hinges[order])
    angles = _angles(rest, vertices) if rest_angles else np.zeros(len(vertices))
    return Bend(vertices, angles, (area / (rigidity * length_sq))[order], starts, colours)


@njit(cache=True, error_model="numpy")
def _angles(x, vertices):
    angles = np.empty(len(vertices))
    for i in range(len(vertices)):
        a, b, c, d = vertices[i, 0], vertices[i, 1], vertices[i, 2], vertices[i, 3]
        angles[i] = dihedral(load(x, a), load(x, b), load(x, c), load(x, d))[0]
    return angles


@njit(cache=True, error_model="numpy")
def project_bend(x, inverse_mass, data, multipliers, h_sq, threaded):
    """Solve each hinge once, in order, in place. Arguments as `project_stretch`, multipliers of shape (H,) [N·m·s²]."""
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
    for i in range(data.starts[block], data.starts[block + 1]):
        a, b, c, d = data.vertices[i, 0], data.vertices[i, 1], data.vertices[i, 2], data.vertices[i, 3]
        xa, xb, xc, xd = load(x, a), load(x, b), load(x, c), load(x, d)
        angle, ga, gb, gc, gd = dihedral(xa, xb, xc, xd)
        wa, wb, wc, wd = inverse_mass[a], inverse_mass[b], inverse_mass[c], inverse_mass[d]
        soft = data.compliance[i] / h_sq
        weight = wa * dot(ga, ga) + wb * dot(gb, gb) + wc * dot(gc, gc) + wd * dot(gd, gd)
        if weight == 0.0:
            continue
        shift = -(angle - data.rest[i] + soft * multipliers[i]) / (weight + soft)
        multipliers[i] += shift
        store(x, a, axpy(shift * wa, ga, xa))
        store(x, b, axpy(shift * wb, gb, xb))
        store(x, c, axpy(shift * wc, gc, xc))
        store(x, d, axpy(shift * wd, gd, xd))


@njit(cache=True, error_model="numpy")
def add_bend_forces(x, data, forces):
    """Add the hinges' forces [N] to `forces`, shape (V, 3), and return their energy [J]."""
    energy = 0.0
    for i in range(len(data.vertices)):
        a, b, c, d = data.vertices[i, 0], data.vertices[i, 1], data.vertices[i, 2], data.vertices[i, 3]
        angle, ga, gb, gc, gd = dihedral(load(x, a), load(x, b), load(x, c), load(x, d))
        moment = -(angle - data.rest[i]) / data.compliance[i]
        energy -= 0.5 * moment * (angle - data.rest[i])
        store(forces, a, axpy(moment, ga, load(forces, a)))
        store(forces, b, axpy(moment, gb, load(forces, b)))
        store(forces, c, axpy(moment, gc, load(forces, c)))
        store(forces, d, axpy(moment, gd, load(forces, d)))
    return energy
