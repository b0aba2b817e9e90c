"""Bind one mesh to another: a render mesh to a simulation mesh, a fine simulation mesh to a coarse one.

A vertex is bound to the nearest triangle that faces the same way, at barycentric coordinates, and at a height along the
interpolated vertex normal. What that leaves over (at the rim, where the projection falls outside) is kept in the
frame of the triangle and turns with it, so the pose it was bound in gives the mesh back exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.vector import axpy, cross, load, scale, store, sub, unit

_FACING = 0.0  # least cosine between the normals of a vertex and its triangle: the other layer of a fold faces away


@dataclass(frozen=True)
class Binding:
    """Where each vertex of the riding mesh sits on the other.

    Args:
        corners: Vertices of its triangle of the other, shape (R, 3).
        weights: Barycentric, rows sum to 1, shape (R, 3).
        height: Along the interpolated vertex normal [m], shape (R,).
        residual: The rest, in the frame of the triangle [m], shape (R, 3).
        faces: Of the other, shape (F, 3).
        count: Vertices of the other.
        turned_away: Vertices for which no triangle near by faces the same way.
    """

    corners: IntArray
    weights: FloatArray
    height: FloatArray
    residual: FloatArray
    faces: IntArray
    count: int
    turned_away: int


def bind(rider: TriangleMesh, mesh: TriangleMesh) -> Binding:
    """Bind a mesh to the one it was made from or that was made from it.

    Args:
        rider: In the pose of `mesh` [m].
        mesh: What will move.
    """
    points, normals = rider.vertices, vertex_normals(rider)
    face = SurfaceDistance(mesh).nearest(points).face
    away = np.einsum("ij,ij->i", normals, face_normals(mesh)[face]) < _FACING
    face, turned_away = _facing_faces(face, away, points, normals, mesh)
    corners = mesh.faces[face]
    weights = _clamped_barycentric(points, mesh.vertices[corners])
    surface, up = _on_surface(mesh.vertices, vertex_normals(mesh), corners, weights)
    height = np.einsum("ij,ij->i", points - surface, up)
    left = points - surface - height[:, None] * up
    frames = _frames(mesh.vertices[corners])
    residual = np.einsum("nij,nj->ni", frames, left)
    return Binding(corners, weights, height, residual, mesh.faces, len(mesh.vertices), turned_away)


def apply(binding: Binding, positions: FloatArray) -> FloatArray:
    """Return the riding vertices [m], shape (R, 3), for positions of the other mesh [m], shape (V, 3)."""
    mesh = TriangleMesh(positions, binding.faces)
    normals, kept = vertex_normals(mesh), (binding.corners, binding.weights, binding.height, binding.residual)
    riding = np.empty((len(binding.corners), 3))
    _ride(mesh.vertices, normals, *kept, riding)
    return riding


@njit(cache=True, error_model="numpy", parallel=True)
def _ride(x, normals, corners, weights, height, residual, riding):  # type: ignore[no-untyped-def]  # typed by Numba
    for r in prange(len(corners)):
        i, j, k = load(corners, r)
        u, v, w = load(weights, r)
        p, q, s = load(residual, r)
        a, b, c = load(x, i), load(x, j), load(x, k)
        up = unit(axpy(u, load(normals, i), axpy(v, load(normals, j), scale(w, load(normals, k)))))
        along, normal = unit(sub(b, a)), unit(cross(sub(b, a), sub(c, a)))
        left = axpy(p, along, axpy(q, cross(normal, along), scale(s, normal)))
        store(riding, r, axpy(u, a, axpy(v, b, axpy(w, c, axpy(height[r], up, left)))))


def _facing_faces(
    face: IntArray, away: np.ndarray, points: FloatArray, normals: FloatArray, sim: TriangleMesh
) -> tuple[IntArray, int]:
    """Return for each vertex whose nearest face looks away the nearest one that does not, and how many have none."""
    from scipy.spatial import cKDTree

    if not away.any():
        return face, 0
    facing = face_normals(sim)
    centres = sim.vertices[sim.faces].mean(axis=1)
    _, near = cKDTree(centres).query(points[away], k=min(32, len(centres)))
    near = near.reshape(int(away.sum()), -1)
    fits = np.einsum("nkj,nj->nk", facing[near], normals[away]) >= _FACING
    found = near[np.arange(len(near)), fits.argmax(axis=1)]
    face = face.copy()
    face[away] = np.where(fits.any(axis=1), found, face[away])
    return face, int((~fits.any(axis=1)).sum())


def _clamped_barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the weights of the point of each triangle (R, 3, 3) nearest in its plane, kept inside, shape (R, 3)."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    ap = points - a
    aa, bb, cc = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    p, q = _dot(ab, ap), _dot(ac, ap)
    det = np.maximum(aa * cc - bb * bb, 1e-300)
    v, w = (cc * p - bb * q) / det, (aa * q - bb * p) / det
    weights = np.clip(np.column_stack([1.0 - v - w, v, w]), 0.0, None)
    return weights / weights.sum(axis=1, keepdims=True)


def _on_surface(
    positions: FloatArray, normals: FloatArray, corners: IntArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the surface point and the unit interpolated normal at the weights, shape (R, 3) each."""
    surface = np.einsum("nk,nkj->nj", weights, positions[corners])
    up = np.einsum("nk,nkj->nj", weights, normals[corners])
    length = np.linalg.norm(up, axis=1, keepdims=True)
    return surface, np.divide(up, length, out=np.zeros_like(up), where=length > 0.0)


def _frames(corners: FloatArray) -> FloatArray:
    """Return an orthonormal frame of each triangle (R, 3, 3), rows: first edge, in-plane, normal."""
    along = corners[:, 1] - corners[:, 0]
    normal = np.cross(along, corners[:, 2] - corners[:, 0])
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return np.stack([along, np.cross(normal, along), normal], axis=1)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.einsum("ij,ij->i", a, b)
