"""The bending energy of the model "shape_operator" a second time: ½ θᵀ M θ over the hinge angles θ.

The curvature of a triangle follows from how the surface turns from it to the middle of each edge: half the angle there,
and shares of four more angles such that every quadratic surface turns as it should. Points are complex numbers here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from vto_pipeline.cloth.judge.strain import rest_triangles
from vto_pipeline.geometry.topology import hinge_halves
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh

_DAMPED = 1e-3  # of the mean squared angle: what keeps shares small where few hinges say little
_SOFTEST = 1e-3  # of the stiffer direction: the stiffness of a direction without any
_Points = NDArray[np.complex128]
_Halves = NDArray[np.int64]


def curvature_stiffness(mesh: TriangleMesh, laid: FloatArray, bends: NDArray[np.bool_], fabric: Fabric) -> csr_array:
    """Return M [N·m], shape (H, H), for the hinges of `geometry.topology.hinges`.

    Args:
        mesh: Its triangles.
        laid: Their corners at rest [m], shape (F, 3, 3).
        bends: Which of them do, shape (F,).
        fabric: Bending rigidities.
    """
    pairs = hinge_halves(mesh).astype(np.int64)
    (inner,) = np.nonzero(bends[pairs // 3].all(axis=1))
    across, hinge = (np.full(3 * len(laid), -1, np.int64) for _ in range(2))
    across[pairs[inner]], hinge[pairs[inner]] = pairs[inner][:, ::-1], inner[:, None]
    half = np.arange(len(across))
    second, third = 3 * (half // 3) + (half + 1) % 3, 3 * (half // 3) + (half + 2) % 3
    beyond = across.clip(0)
    around = np.stack([half, second, third, second[beyond], third[beyond]], axis=1)
    shares = np.zeros((len(half), 5))
    turning = np.flatnonzero(across >= 0)
    shares[turning] = _shares(laid, across, around, turning)
    found = np.where((across >= 0)[:, None], hinge[around], -1)
    shares[found < 0] = 0.0

    area, normals = _edge_curvatures(laid, bends)
    per_angle = np.einsum("fec,fes->fces", normals, shares.reshape(-1, 3, 5)).reshape(len(laid), 3, 15)
    rigidity = _rigidity(fabric)
    free = (across < 0).reshape(-1, 3)
    for face in np.flatnonzero(bends & free.any(axis=1) & ~free.all(axis=1)):  # turns there are those that cost least
        ways = normals[face, free[face]].T
        per_angle[face] -= ways @ np.linalg.pinv(ways.T @ rigidity @ ways) @ ways.T @ rigidity @ per_angle[face]
    rows = np.broadcast_to(np.arange(3 * len(laid)).reshape(-1, 3, 1), per_angle.shape)
    columns = np.broadcast_to(found.clip(0).reshape(-1, 1, 15), per_angle.shape)
    places = (rows.ravel(), columns.ravel())
    curvature = csr_array((per_angle.ravel(), places), (3 * len(laid), len(pairs)))
    return csr_array(curvature.T @ block_diag(list(area[:, None, None] * rigidity), format="csr") @ curvature)


def _rigidity(fabric: Fabric) -> FloatArray:
    """Return D [N·m], shape (3, 3): warp, weft, and for twice the twist half an isotropic sheet's."""
    warp, weft = fabric.bending_warp, fabric.bending_weft
    warp, weft = max(warp, _SOFTEST * weft), max(weft, _SOFTEST * warp)
    return np.diag([warp, weft, 0.5 * np.sqrt(warp * weft)])


def _edge_curvatures(laid: FloatArray, bends: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
    """Return areas [m²], shape (F,), and curvature per turn across each edge [1/m], shape (F, edge, component)."""
    area, normals = np.zeros(len(laid)), np.zeros((len(laid), 3, 3))
    flat = rest_triangles(laid[bends])
    one, two = np.linalg.inv(flat.inverse).transpose(2, 0, 1)  # corners 0 and 1 from corner 2, along warp and weft
    edges = np.stack([two - one, -two, one], axis=1)
    warp, weft = edges[..., 1], -edges[..., 0]  # across the edge
    per_turn = np.stack([warp**2, weft**2, 2.0 * warp * weft], axis=2)
    length = np.linalg.norm(edges, axis=2)
    area[bends], normals[bends] = flat.area, per_turn / (length * flat.area[:, None])[:, :, None]
    return area, normals


def _shares(laid: FloatArray, across: _Halves, around: _Halves, turning: _Halves) -> FloatArray:
    """Return how much of the five angles about an edge makes the turn from its triangle to its middle, shape (N, 5)."""
    length = np.linalg.norm(np.roll(laid, -1, axis=1) - laid, axis=2).ravel()
    head = 0.5 * length[turning] + 0.0j
    tail = -head

    def apex(start: _Points, end: _Points, half: _Halves) -> _Points:
        """Return the third corner of these faces, left of their edges, which run from start to end, sewn to length."""
        first = 3 * (half // 3)
        edge, right, left = length[half], length[first + (half + 1) % 3], length[first + (half + 2) % 3]
        along = (edge**2 + left**2 - right**2) / (2.0 * edge)
        height = np.sqrt(np.maximum(left**2 - along**2, 0.0))
        return np.asarray(start + (end - start) * (along / edge + 1j * height / abs(end - start)))

    own, other = apex(tail, head, turning), apex(head, tail, across[turning])
    sides = [(tail, head, own), (head, own, tail), (own, tail, head), (tail, other, head), (other, head, tail)]
    angles = np.zeros((len(turning), 3, 5))
    for k, (start, end, left) in enumerate(sides):
        far = across[around[turning, k]]
        known = far >= 0
        right = apex(end, start, far.clip(0))
        angles[known, :, k] = (_slopes(start, end, right) - _slopes(start, end, left))[known]
    wanted = -_slopes(tail, head, own) - 0.5 * angles[:, :, 0]
    damping = _DAMPED / 3.0 * np.einsum("nks,nks->n", angles, angles)
    normal = angles.transpose(0, 2, 1) @ angles + damping[:, None, None] * np.eye(5)
    shares: FloatArray = np.linalg.solve(normal, np.einsum("nks,nk->ns", angles, wanted)[:, :, None])[:, :, 0]
    shares[:, 0] += 0.5
    return shares


def _slopes(start: _Points, end: _Points, apex: _Points) -> FloatArray:
    """Return the slopes, left of an edge, of triangles with corners on the quadratics xx/2, yy/2, xy, shape (N, 3)."""

    def heights(z: _Points) -> FloatArray:
        return np.column_stack([0.5 * z.real**2, 0.5 * z.imag**2, z.real * z.imag])

    place = (apex - start) / (end - start)
    edge = (1.0 - place.real)[:, None] * heights(start) + place.real[:, None] * heights(end)
    return np.asarray((heights(apex) - edge) / (place.imag * abs(end - start))[:, None])
