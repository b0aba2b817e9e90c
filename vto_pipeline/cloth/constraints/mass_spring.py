"""A sheet as a mass-spring system: structural, shear and second-neighbour bending springs (Provot 1995).

Springs know only the distance of their ends, so there is no free choice of Poisson's ratio: any net of springs has the
warp-weft stiffness K_uv = G (Cauchy's relation), and what resists shear differs from place to place on all but regular
meshes. Bending springs resist with the fourth power of the angle: hardly at all at small ones.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bending.hinge import Hinges, solid_hinges
from vto_pipeline.cloth.constraints.membrane.yarns import thread_axes
from vto_pipeline.cloth.constraints.points.spring import Spring, springs
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

_SHEAR_COUNTS = 0.1  # beside stretch, where springs in all directions cannot be as soft in shear as a fabric
_FOLD = 1.0  # rad, at which a bending spring costs as much as the hinge it stands for


def membrane_springs(mesh: TriangleMesh, rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Spring:
    """Return springs along all edges, and across edges that are the diagonal of a quad.

    A spring of length l that stands for an area A has the stiffness c A / l². Of c there are three, for springs along
    warp, along weft and on the bias, with a smooth passage between; they are such that, on average over the mesh,
    stretch along warp and weft and shear cost what the fabric says, as far as springs that push can do it.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Stiffnesses; Poisson's ratio is not used.
        damping: Rayleigh's β [s].
    """
    from scipy.optimize import nnls  # a tenth of a second, which other membranes do not need

    along, edge_pairs, edge_area = _edges(mesh.faces, rest.corners(mesh.faces))
    across, diagonal_pairs, diagonal_area = _diagonals(solid_hinges(mesh, rest))
    direction, area = np.vstack([along, across]), np.concatenate([edge_area, diagonal_area])
    length_sq = np.einsum("ij,ij->i", direction, direction)
    u, v = direction.T**2 / length_sq  # squared cosine and sine of the angle to the warp
    bias = 4.0 * u * v
    shares = np.column_stack([np.where(u > v, 1.0 - bias, 0.0), np.where(u > v, 0.0, 1.0 - bias), bias])
    responses = np.stack([u * u, v * v, u * v]) * (area / edge_area.sum())
    warp, weft, shear = fabric.stretch_warp, fabric.stretch_weft, fabric.shear
    wanted = np.array([_confined(warp, weft, shear), _confined(weft, warp, shear), shear])
    weigh = np.array([1.0, 1.0, _SHEAR_COUNTS])
    factors, _ = nnls((weigh / wanted)[:, None] * (responses @ shares), weigh)
    stiffness = shares @ factors * area / length_sq
    pairs, place = np.unique(np.sort(np.vstack([edge_pairs, diagonal_pairs]), axis=1), axis=0, return_inverse=True)
    total = np.bincount(place.reshape(-1), stiffness, len(pairs))
    lengths = np.empty(len(pairs))
    lengths[place.reshape(-1)] = np.sqrt(length_sq)
    used = total > 0.0
    return springs(pairs[used], rest.positions, 1.0 / total[used], rest=lengths[used], damping=damping)


def _confined(along: float, across: float, shear: float) -> float:
    """Return K_uu such that the sheet, with K_uv = G, has the stiffness `along` when it may narrow."""
    return 0.5 * (along + sqrt(along**2 + 4.0 * shear**2 * along / across))


def _edges(
    faces: NDArray[np.int32], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Return (warp, weft) parts [m], ends, and area [m²] of each face's edges, shapes (3F, 2), (3F, 2), (3F,)."""
    warp, weft, double_area = thread_axes(corners)
    solid = double_area > 1e-12 * double_area.max(initial=0.0)
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)[solid]
    edge = (np.roll(corners, -1, axis=1) - corners)[solid]
    parts = np.stack([np.einsum("fkd,fd->fk", edge, axis[solid]) for axis in (warp, weft)], axis=2)
    return parts.reshape(-1, 2), pairs.reshape(-1, 2), np.repeat(double_area[solid] / 6.0, 3)


def _unfolded(
    corners: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return how far along the hinge the second wing is from the first, and the wings' heights [m], each (H,).

    Args:
        corners: Ends and wing of either triangle [m], shape (H, 2, 3, 3).
    """
    feet, heights = [], []
    for k in (0, 1):
        first, second, wing = corners[:, k].transpose(1, 0, 2)
        edge, side = second - first, wing - first
        length = np.linalg.norm(edge, axis=1)
        foot = np.einsum("ij,ij->i", side, edge) / length
        feet.append(foot)
        heights.append(np.linalg.norm(side - (foot / length)[:, None] * edge, axis=1))
    return feet[1] - feet[0], heights[0], heights[1]


def _diagonals(
    found: Hinges,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Return (warp, weft) parts, ends and area of second diagonals, where an edge is the longest of both its faces."""
    sides = found.corners[:, :, 2:] - found.corners[:, :, :2]
    longest = found.length > 1.001 * np.linalg.norm(sides, axis=3).max(axis=(1, 2))
    kept, area, corners = found.vertices[longest], found.area[longest], found.corners[longest]
    warp, weft, _ = thread_axes(corners[:, 0])
    edge = corners[:, 0, 1] - corners[:, 0, 0]
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    u, v = np.einsum("ij,ij->i", edge, warp), np.einsum("ij,ij->i", edge, weft)
    along, above, below = _unfolded(corners)
    down = above + below  # from the first wing, which lies to the left of the edge, to the second
    return np.column_stack([along * u + down * v, along * v - down * u]), kept[:, 2:], area / 3.0


def bending_springs(mesh: TriangleMesh, rest: RestShape, fabric: Fabric, damping: float = 0.0) -> Spring:
    """Return springs between the wings of hinges: second neighbours, that come closer as the sheet bends.

    Args:
        mesh: Its triangles.
        rest: Its shape without forces.
        fabric: Bending rigidities. At a fold of 1 rad from flat each spring costs what its hinge would.
        damping: Rayleigh's β [s].
    """
    found = solid_hinges(mesh, rest)
    stiffness = found.stiffness(fabric)
    stiff = stiffness > 0.0
    kept = found.vertices[stiff]
    along, above, below = _unfolded(found.corners[stiff])

    def distance(fold: NDArray[np.float64] | float) -> NDArray[np.float64]:
        apart: NDArray[np.float64] = np.sqrt(along**2 + above**2 + below**2 + 2.0 * above * below * np.cos(fold))
        return apart

    shortened = distance(0.0) - distance(_FOLD)
    compliance = shortened**2 / (stiffness[stiff] * _FOLD**2)
    return springs(kept[:, 2:], rest.positions, compliance, rest=distance(found.angle[stiff]), damping=damping)
