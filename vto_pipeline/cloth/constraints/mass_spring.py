"""A sheet as a mass-spring system: structural, shear and second-neighbour bending springs (Provot 1995).

Springs know only the distance of their ends, so there is no free choice of Poisson's ratio: any net of springs has the
warp-weft stiffness K_uv = G (Cauchy's relation), and what resists shear differs from place to place on all but regular
meshes. Bending springs resist with the fourth power of the angle: hardly at all at small ones.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bending.hinge import solid_hinges
from vto_pipeline.cloth.constraints.membrane.yarns import thread_axes
from vto_pipeline.cloth.constraints.points.spring import Spring, springs
from vto_pipeline.model.fabric import Fabric

_SHEAR_COUNTS = 0.1  # beside stretch, where springs in all directions cannot be as soft in shear as a fabric
_FOLD = 1.0  # rad, at which a bending spring costs as much as the hinge it stands for


def membrane_springs(
    faces: NDArray[np.int32],
    hinges: NDArray[np.int32],
    rest: NDArray[np.float64],
    fabric: Fabric,
    damping: float = 0.0,
) -> Spring:
    """Return springs along all edges, and across edges that are the diagonal of a quad.

    A spring of length l that stands for an area A has the stiffness c A / l². Of c there are three, for springs along
    warp, along weft and on the bias, with a smooth passage between; they are such that, on average over the mesh,
    stretch along warp and weft and shear cost what the fabric says, as far as springs that push can do it.

    Args:
        faces: Shape (F, 3).
        hinges: Ends and wings as from `geometry.topology.hinges`, shape (H, 4).
        rest: Rest positions [m], shape (V, 3).
        fabric: Stiffnesses; Poisson's ratio is not used.
        damping: Rayleigh's β [s].
    """
    from scipy.optimize import nnls  # a tenth of a second, which other membranes do not need

    along, edge_pairs, edge_area = _edges(faces, rest)
    across, diagonal_pairs, diagonal_area = _diagonals(hinges, rest)
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
    return springs(pairs[used], rest, 1.0 / total[used], rest=lengths[used], damping=damping)


def _confined(along: float, across: float, shear: float) -> float:
    """Return K_uu such that the sheet, with K_uv = G, has the stiffness `along` when it may narrow."""
    return 0.5 * (along + sqrt(along**2 + 4.0 * shear**2 * along / across))


def _edges(
    faces: NDArray[np.int32], rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Return (warp, weft) parts [m], ends, and area [m²] of each face's edges, shapes (3F, 2), (3F, 2), (3F,)."""
    warp, weft, double_area = thread_axes(faces, rest)
    solid = double_area > 1e-12 * double_area.max(initial=0.0)
    pairs = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)[solid]
    edge = rest[pairs[:, :, 1]] - rest[pairs[:, :, 0]]
    parts = np.stack([np.einsum("fkd,fd->fk", edge, axis[solid]) for axis in (warp, weft)], axis=2)
    return parts.reshape(-1, 2), pairs.reshape(-1, 2), np.repeat(double_area[solid] / 6.0, 3)


def _unfolded(
    hinges: NDArray[np.int32], rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return how far along the hinge the second wing is from the first, and the wings' heights [m], each (H,)."""
    edge = rest[hinges[:, 1]] - rest[hinges[:, 0]]
    length_sq = np.einsum("ij,ij->i", edge, edge)
    feet, heights = [], []
    for wing in (2, 3):
        side = rest[hinges[:, wing]] - rest[hinges[:, 0]]
        foot = np.einsum("ij,ij->i", side, edge) / length_sq
        feet.append(foot)
        heights.append(np.linalg.norm(side - foot[:, None] * edge, axis=1))
    return (feet[1] - feet[0]) * np.sqrt(length_sq), heights[0], heights[1]


def _diagonals(
    hinges: NDArray[np.int32], rest: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Return (warp, weft) parts, ends and area of second diagonals, where an edge is the longest of both its faces."""
    found, _ = solid_hinges(hinges, rest)
    corners = rest[found.vertices]
    sides = corners[:, 2:, None] - corners[:, None, :2]
    longest = found.length > 1.001 * np.linalg.norm(sides, axis=3).max(axis=(1, 2))
    kept, area = found.vertices[longest], found.area[longest]
    warp, weft, _ = thread_axes(kept[:, [0, 1, 2]], rest)
    edge = rest[kept[:, 1]] - rest[kept[:, 0]]
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    u, v = np.einsum("ij,ij->i", edge, warp), np.einsum("ij,ij->i", edge, weft)
    along, above, below = _unfolded(kept, rest)
    down = above + below  # from the first wing, which lies to the left of the edge, to the second
    return np.column_stack([along * u + down * v, along * v - down * u]), kept[:, 2:], area / 3.0


def bending_springs(
    hinges: NDArray[np.int32],
    rest: NDArray[np.float64],
    rest_angles: NDArray[np.float64] | None,
    fabric: Fabric,
    damping: float = 0.0,
) -> Spring:
    """Return springs between the wings of hinges: second neighbours, that come closer as the sheet bends.

    Args:
        hinges: Ends and wings as from `geometry.topology.hinges`, shape (H, 4).
        rest: Rest positions [m], shape (V, 3).
        rest_angles: Of each hinge [rad], shape (H,); flat when None.
        fabric: Bending rigidities. At a fold of 1 rad from flat each spring costs what its hinge would.
        damping: Rayleigh's β [s].
    """
    found, solid = solid_hinges(hinges, rest)
    stiffness = found.stiffness(fabric)
    stiff = stiffness > 0.0
    kept = found.vertices[stiff]
    along, above, below = _unfolded(kept, rest)
    angle = np.zeros(len(kept)) if rest_angles is None else rest_angles[solid][stiff]

    def distance(fold: NDArray[np.float64] | float) -> NDArray[np.float64]:
        apart: NDArray[np.float64] = np.sqrt(along**2 + above**2 + below**2 + 2.0 * above * below * np.cos(fold))
        return apart

    shortened = distance(0.0) - distance(_FOLD)
    compliance = shortened**2 / (stiffness[stiff] * _FOLD**2)
    return springs(kept[:, 2:], rest, compliance, rest=distance(angle), damping=damping)
