"""A piece of a surface laid flat with the least work of its fabric.

The panel is sought that costs the least membrane energy when it is stretched to the surface: its warp, its weft and
its shear count as the fabric resists them. In front of that, a conformal map, and the symmetric Dirichlet energy
(Smith & Schaefer 2015) lowered by SLIM (Rabinovich, Poranne, Panozzo & Sorkine-Hornung 2017, in libigl), which knows no
directions. The last part is a Gauss-Newton method on the Green strain from the panel to the surface, which grows
without bound where a triangle closes up: with steps cut short before any does, no triangle is ever flipped. Where one
grows, the strain tends to a half only: steps are cut short there as well, or corners fly off.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import factorized, splu

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.topology import boundary_loops, edges, face_areas
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh

_ISOTROPIC_ROUNDS = 40
_ROUNDS = 40
_CONVERGED = 1e-6  # of the energy
_HALVINGS = 12
_LEAST = 1e-3  # of its area at first that a triangle keeps; of a side, the least height: scans have slivers
_MOST = 3.0  # times its length at first that an edge grows to: the strain is bounded there, so corners would fly off
_HOLD = 1e-7  # of the stiffness: which place and turn the panel has does not matter
_UPRIGHT = 0.3  # a mean of unit vectors shorter than this points nowhere


def flatten(mesh: TriangleMesh, warp: FloatArray, fabric: Fabric) -> FloatArray:
    """Return where the vertices of a piece lie in its panel [m], the warp along y, shape (V, 2).

    Args:
        mesh: A disc in space [m].
        warp: Which way the warp runs in each face, shape (F, 3); zero: unknown.
        fabric: Its stiffness says which stretch is taken first.

    Raises:
        GarmentError: the piece cannot be laid flat without flipping a triangle.
    """
    own = _own_shapes(mesh)
    flat = _upright(mesh, _isotropic(mesh, own), warp)
    return _orthotropic(mesh, own, flat, fabric)


def stretches(mesh: TriangleMesh, flat: FloatArray) -> FloatArray:
    """Return the largest and the least stretch of each face from the plane to space, shape (F, 2)."""
    laid = flat[mesh.faces]
    sides = np.swapaxes(mesh.vertices[mesh.faces][:, 1:] - mesh.vertices[mesh.faces][:, :1], 1, 2)
    to_space = sides @ np.linalg.inv(np.swapaxes(laid[:, 1:] - laid[:, :1], 1, 2))
    return np.asarray(np.linalg.svd(to_space, compute_uv=False))


def flat_areas(flat: FloatArray, faces: IntArray) -> FloatArray:
    """Return the areas of faces in the plane, negative where flipped [m²], shape (F,)."""
    laid = flat[faces]
    return np.asarray(0.5 * np.linalg.det(laid[:, 1:] - laid[:, :1]))


def _own_shapes(mesh: TriangleMesh) -> FloatArray:
    """Return two sides of each face as columns in a plane of its own, shape (F, 2, 2)."""
    corners = mesh.vertices[mesh.faces]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    length = np.linalg.norm(first, axis=1)
    along = np.einsum("fd,fd->f", first, second) / length
    height = np.maximum(np.linalg.norm(np.cross(first, second), axis=1) / length, _LEAST * length)
    return np.stack([np.stack([length, along], axis=1), np.stack([0.0 * length, height], axis=1)], axis=1)


def _isotropic(mesh: TriangleMesh, own: FloatArray) -> FloatArray:
    import igl

    start = _conformal(mesh)
    if not (flat_areas(start, mesh.faces) > 0.0).all():
        start = _convex(mesh)
    wanted = 0.5 * np.linalg.det(own).sum()
    start = start * np.sqrt(wanted / flat_areas(start, mesh.faces).sum())
    data = igl.slim_precompute(
        np.asfortranarray(mesh.vertices),
        np.asfortranarray(mesh.faces, dtype=np.int32),
        np.asfortranarray(start),
        igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
        np.zeros(0, np.int32),
        np.asfortranarray(np.zeros((0, 2))),
        0.0,
    )
    flat = np.array(igl.slim_solve(data, _ISOTROPIC_ROUNDS)[:, :2])
    if not (np.isfinite(flat).all() and (flat_areas(flat, mesh.faces) > 0.0).all()):
        raise GarmentError("a piece cannot be laid flat without folds", hint="it may need a seam or a dart more")
    return flat


def _conformal(mesh: TriangleMesh) -> FloatArray:
    import igl

    (loop,) = boundary_loops(mesh)
    apart = np.linalg.norm(mesh.vertices[loop] - mesh.vertices[loop[0]], axis=1)
    held = np.array([loop[0], loop[int(np.argmax(apart))]], np.int64)
    places = np.array([[0.0, 0.0], [0.0, apart.max()]])
    return np.asarray(igl.lscm(mesh.vertices, mesh.faces.astype(np.int64), held, places)[0])


def _convex(mesh: TriangleMesh) -> FloatArray:
    """Return the piece within a circle, each vertex in the middle of its neighbours, which flips none (Tutte)."""
    (loop,) = boundary_loops(mesh)
    sides = np.linalg.norm(np.roll(mesh.vertices[loop], -1, axis=0) - mesh.vertices[loop], axis=1)
    angle = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(sides)[:-1]]) / sides.sum()
    flat = np.zeros((len(mesh.vertices), 2))
    flat[loop] = np.column_stack([np.cos(angle), np.sin(angle)])
    a, b = edges(mesh).T
    ones = np.ones(2 * len(a))
    links = coo_array((ones, (np.r_[a, b], np.r_[b, a])), shape=(len(flat),) * 2).tocsr()
    inner = np.setdiff1d(np.arange(len(flat)), loop)
    if len(inner):
        matrix = csc_array(_diagonal(links.sum(axis=1)[inner]) - links[inner][:, inner])
        solve = factorized(matrix)
        right = links[inner] @ flat
        flat[inner] = np.column_stack([solve(right[:, k]) for k in range(2)])
    return flat


def _upright(mesh: TriangleMesh, flat: FloatArray, warp: FloatArray) -> FloatArray:
    """Return a panel turned so that the warp runs along y; where it points nowhere, the panel's longest way does."""
    corners = mesh.vertices[mesh.faces]
    sides = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    laid = flat[mesh.faces]
    in_plane = np.swapaxes(laid[:, 1:] - laid[:, :1], 1, 2) @ np.linalg.pinv(sides) @ warp[:, :, None]
    area = face_areas(mesh)
    mean = (area[:, None] * in_plane[:, :, 0]).sum(axis=0) / area.sum()
    if np.linalg.norm(mean) < _UPRIGHT:
        middle = laid.mean(axis=1)
        about = middle - (area[:, None] * middle).sum(axis=0) / area.sum()
        longest = np.linalg.eigh((area[:, None] * about).T @ about)[1][:, 1]
        mean = longest * (1.0 if longest @ mean >= 0.0 else -1.0)
    x, y = mean / np.linalg.norm(mean)
    return np.asarray(flat @ np.array([[y, x], [-x, y]]))


def _orthotropic(mesh: TriangleMesh, own: FloatArray, flat: FloatArray, fabric: Fabric) -> FloatArray:
    """Return the panel of least membrane energy, from a near one."""
    energy = _Energy(mesh, own, fabric)
    x = flat
    about = flat - flat.mean(axis=0)
    turn = np.column_stack([-about[:, 1], about[:, 0]]).ravel()  # no step turns the panel: its warp is known
    least = _LEAST * flat_areas(flat, mesh.faces)
    a, b = edges(mesh).T
    most = _MOST * np.linalg.norm(flat[a] - flat[b], axis=1)
    before, right, normal = energy.at(x)
    for _ in range(_ROUNDS):
        solver = splu(normal, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        step, turning = solver.solve(right), solver.solve(turn)
        step = (step - (turn @ step) / (turn @ turning) * turning).reshape(-1, 2)
        for halving in range(_HALVINGS):
            tried = x + 0.5**halving * step
            near = (np.linalg.norm(tried[a] - tried[b], axis=1) < most).all()
            if near and (flat_areas(tried, mesh.faces) > least).all():
                now, right, normal = energy.at(tried)
                if now < before:
                    break
        else:
            break
        x, gain, before = tried, before - now, now
        if gain < _CONVERGED * before:
            break
    return np.asarray(x - x.mean(axis=0))


class _Energy:
    """Of the membrane, stretched from its panel to the surface."""

    def __init__(self, mesh: TriangleMesh, own: FloatArray, fabric: Fabric) -> None:
        faces, count = mesh.faces, len(mesh.vertices)
        self._faces = faces
        area = face_areas(mesh)
        self._root = np.sqrt(area)[:, None, None] * _root_of_stiffness(fabric)
        inverse = np.linalg.inv(own)
        self._share = np.concatenate([-inverse.sum(axis=1)[:, None], inverse], axis=1)
        rows = np.arange(3 * len(faces)).reshape(-1, 3, 1)
        columns = np.stack([2 * faces, 2 * faces + 1], axis=2).reshape(-1, 1, 6)
        self._rows, self._columns = (np.broadcast_to(x, (len(faces), 3, 6)).ravel() for x in (rows, columns))
        self._shape = (3 * len(faces), 2 * count)
        self._hold = _HOLD * (fabric.stretch_warp + fabric.stretch_weft) * eye_array(2 * count, format="csc")

    def at(self, x: FloatArray) -> tuple[float, FloatArray, csc_array]:
        """Return twice the energy, and right side and matrix of the normal equations of a step."""
        strain, slope = _strain(x, self._faces, self._share)
        wrong = (self._root @ strain[:, :, None]).ravel()
        slopes = (self._root @ slope).ravel()
        jacobian = csc_array(coo_array((slopes, (self._rows, self._columns)), shape=self._shape))
        return float(wrong @ wrong), -(jacobian.T @ wrong), csc_array(jacobian.T @ jacobian + self._hold)


def _strain(x: FloatArray, faces: IntArray, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the Green strain from panel to space: warp, weft, engineering shear (F, 3), and its slope (F, 3, 6).

    Args:
        x: Of the panel [m], shape (V, 2).
        faces: Shape (F, 3).
        share: What corners add to G, which takes a face's own plane to the panel: G = sum of x share^T, (F, 3, 2).
    """
    g = np.einsum("fnk,fni->fik", share, x[faces])  # from the face's own plane to the panel, (F, 2, 2)
    c = np.linalg.inv(g @ np.swapaxes(g, 1, 2))
    strain = 0.5 * (c - np.eye(2))
    to = np.einsum("fnk,fjk->fnj", share, g)  # moved along i, corner n changes G G^T by e_i to^T + to e_i^T
    left = np.einsum("fpj,fnj->fnp", c, to)
    one = np.einsum("fpi,fnq->fnipq", c, left)
    d = -0.5 * (one + np.swapaxes(one, 3, 4))
    values = np.stack([strain[:, 1, 1], strain[:, 0, 0], 2.0 * strain[:, 0, 1]], axis=1)
    slopes = np.stack([d[..., 1, 1], d[..., 0, 0], 2.0 * d[..., 0, 1]], axis=1)  # (F, 3, n, i)
    return values, slopes.reshape(len(faces), 3, 6)


def _root_of_stiffness(fabric: Fabric) -> FloatArray:
    """Return R, shape (3, 3), with strain R^T R strain the energy per area of warp, weft and shear, doubled."""
    coupled = fabric.poisson * np.sqrt(fabric.stretch_warp * fabric.stretch_weft)
    stiffness = np.array(
        [[fabric.stretch_warp, coupled, 0.0], [coupled, fabric.stretch_weft, 0.0], [0, 0, fabric.shear]]
    )
    stiffness[:2, :2] /= 1.0 - fabric.poisson**2
    return np.asarray(np.linalg.cholesky(stiffness).T)


def _diagonal(values: FloatArray) -> csc_array:
    number = np.arange(len(values))
    return csc_array((np.asarray(values).ravel(), (number, number)), shape=(len(values),) * 2)
