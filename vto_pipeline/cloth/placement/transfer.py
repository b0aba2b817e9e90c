"""Reshape a garment with its body: tight parts keep their distance, others their proportions.

After Brouet, Sheffer, Boissieux & Cani 2012, "Design preserving garment transfer": each piece of cloth is turned and
stretched as the body nearest to it is, which is then fitted together by least squares, while what lay near the body is
held at the same distance from the same place of it. No simulation, and no promise that nothing crosses.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import splu

from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import face_areas, face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_TIGHT = 0.02  # m: cloth nearer to the body goes with that very place of it, farther off with the region
_FIRM = 0.03  # m: over this length along the cloth, tightness outweighs proportions
_SMOOTH = 0.06  # m: over this length along loose cloth, the change of the body is averaged


def transfer_deformation(cloth: TriangleMesh, source: TriangleMesh, target: TriangleMesh) -> FloatArray:
    """Return the cloth's positions on the target body [m], shape (V, 3).

    Args:
        cloth: About the source body [m]; each piece of it has a triangle.
        source: The body that it is on [m].
        target: The same triangles on the other body [m].
    """
    surface = SurfaceDistance(source).signed(cloth.vertices)
    corners = source.faces[surface.face]
    shares = _barycentric_or_centroid(surface.point, source.vertices[corners])
    near = 1.0 / (1.0 + (surface.distance / _TIGHT) ** 2)
    matrix, area = laplacian(cloth)
    gradient = np.einsum("nk,nkij->nij", shares, _vertex_gradients(source, target)[corners])
    gradient = _smoothed(gradient, matrix, area * near)
    held = np.einsum("nk,nkd->nd", shares, target.vertices[corners])
    held += np.einsum("nij,nj->ni", nearest_rotations(gradient), cloth.vertices - surface.point)
    weight = diags(area * near**2 / _FIRM**2)
    return np.asarray(splu((matrix + weight).tocsc()).solve(divergence(cloth, matrix, gradient) + weight @ held))


def _vertex_gradients(source: TriangleMesh, target: TriangleMesh) -> FloatArray:
    """Return the deformation gradient of the body at each vertex, shape (V, 3, 3).

    The normal of a triangle grows as the root of its area, so that a limb that becomes thicker does so in both ways.
    """
    was, now = (_edges_and_normal(mesh) for mesh in (source, target))
    area = face_areas(source)
    sound = area > 1e-4 * np.median(area)  # a sliver does not tell how it was stretched
    of_face = np.zeros((len(source.faces), 3, 3))
    of_face[sound] = now[sound] @ np.linalg.inv(was[sound])
    area = np.where(sound, area, 0.0)
    summed = np.zeros((len(source.vertices), 3, 3))
    total = np.zeros(len(source.vertices))
    np.add.at(summed, source.faces, (area[:, None, None] * of_face)[:, None])
    np.add.at(total, source.faces, area[:, None])
    known = total > 0.0
    summed[known] /= total[known, None, None]
    summed[~known] = np.eye(3)
    return summed


def _edges_and_normal(mesh: TriangleMesh) -> FloatArray:
    """Return two edges and the normal with the length of the root of the area, as columns, shape (F, 3, 3)."""
    corners = mesh.vertices[mesh.faces]
    root = np.sqrt(face_areas(mesh))[:, None]
    return np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], root * face_normals(mesh)], axis=2)


def _smoothed(gradient: FloatArray, matrix: csr_matrix, weight: FloatArray) -> FloatArray:
    """Return the gradients with what is far from the body, of little weight, taken from around it."""
    held = diags(weight / _SMOOTH**2)
    flat = gradient.reshape(-1, 9)
    return np.asarray(splu((matrix + held).tocsc()).solve(held @ flat)).reshape(-1, 3, 3)


def divergence(cloth: TriangleMesh, matrix: csr_matrix, gradient: FloatArray) -> FloatArray:
    """Return the right side of Poisson's equation for edges turned and stretched by the mean of their ends, (V, 3).

    Args:
        cloth: Whose edges [m].
        matrix: Its Laplacian.
        gradient: At each vertex, shape (V, 3, 3).
    """
    edges = matrix.tocoo()
    i, j, weight = edges.row, edges.col, -edges.data
    apart = i != j
    i, j, weight = i[apart], j[apart], weight[apart]
    wanted = 0.5 * np.einsum("eij,ej->ei", gradient[i] + gradient[j], cloth.vertices[i] - cloth.vertices[j])
    result = np.zeros_like(cloth.vertices)
    np.add.at(result, i, weight[:, None] * wanted)
    return result


def nearest_rotations(gradient: FloatArray) -> FloatArray:
    """Return the rotations nearest to these matrices (polar decomposition), shapes (V, 3, 3)."""
    left, _, right = np.linalg.svd(gradient)
    turn = left @ right
    left[:, :, 2] *= np.sign(np.linalg.det(turn))[:, None]
    return np.asarray(left @ right)


def _barycentric_or_centroid(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return barycentric coordinates of points of triangles, shape (N, 3)."""
    import igl

    a, b, c = (np.ascontiguousarray(corners[:, k]) for k in range(3))
    shares = np.asarray(igl.barycentric_coordinates(np.ascontiguousarray(points), a, b, c))
    sound = np.isfinite(shares).all(axis=1)
    return np.where(sound[:, None], shares, 1.0 / 3.0)
