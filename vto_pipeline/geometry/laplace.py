"""Smooth functions on a surface: the cotangent Laplacian, and harmonic or biharmonic extension of fixed values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import spsolve

from vto_pipeline.geometry.topology import edge_face_counts, face_areas
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

COTANGENT = (0.05, 20.0)
"""Cotangents are kept in this range, so that scanned slivers spoil nothing."""


def laplacian(mesh: TriangleMesh) -> tuple[csr_matrix, FloatArray]:
    """Return the positive semidefinite cotangent Laplacian (V, V) and the area of each vertex [m²], shape (V,).

    Pinkall and Polthier 1993, with cotangents kept in a range.
    """
    corners = mesh.vertices[mesh.faces]
    to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    cotangent = np.einsum("fkd,fkd->fk", to_next, to_last) / np.maximum(across, 1e-18)
    half = 0.5 * np.clip(cotangent, *COTANGENT).reshape(-1)
    i, j = np.roll(mesh.faces, -1, axis=1).reshape(-1), np.roll(mesh.faces, 1, axis=1).reshape(-1)
    count = len(mesh.vertices)
    graph = coo_matrix((np.concatenate([half, half]), (np.concatenate([i, j]), np.concatenate([j, i]))), (count, count))
    graph = graph.tocsr()
    matrix = csr_matrix(diags(np.asarray(graph.sum(axis=1)).reshape(-1)) - graph)
    third = face_areas(mesh) / 3.0
    area = np.bincount(mesh.faces.reshape(-1), np.repeat(third, 3), count)
    return matrix, np.maximum(area, 1e-3 * area.mean())


def extend_smoothly(mesh: TriangleMesh, values: FloatArray, free: NDArray[np.bool_], order: int) -> FloatArray:
    """Return values with those at the free vertices replaced by the smoothest that go with the others.

    Args:
        mesh: The surface.
        values: Shape (V, D).
        free: Which vertices, shape (V,); each piece of the mesh needs some that are not.
        order: 1 harmonic (least slope), 2 biharmonic (least bending). A border that is held bears no moment then:
            the values come to it at any slope.
    """
    if not free.any():
        return values
    matrix = bending(mesh, free)[0] if order == 2 else laplacian(mesh)[0]
    rows = matrix[free]
    solved = spsolve(rows[:, free].tocsc(), -np.asarray(rows[:, ~free] @ values[~free]))
    result = np.array(values, dtype=float)
    result[free] = solved.reshape(-1, values.shape[1])
    return result


def bending(mesh: TriangleMesh, free: NDArray[np.bool_]) -> tuple[csr_matrix, FloatArray]:
    """Return the matrix of a thin plate's bending energy (V, V) [1/m²], and the area of each vertex [m²], shape (V,).

    Args:
        mesh: The surface.
        free: Which vertices may move, shape (V,); a border that may not bears no moment.
    """
    matrix, area = laplacian(mesh)
    pair, count = edge_face_counts(mesh)
    hinged = np.zeros(len(area), dtype=bool)
    hinged[pair[count == 1]] = True
    hinged &= ~free
    return csr_matrix(matrix @ diags(np.where(hinged, 0.0, 1.0 / area)) @ matrix), area
