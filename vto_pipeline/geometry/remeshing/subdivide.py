"""Split long inner edges at their middle until none is left; boundary edges stay whole."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import edge_faces, edges, half_edges
from vto_pipeline.model.arrays import IntArray
from vto_pipeline.model.mesh import TriangleMesh


def split_long_edges(mesh: TriangleMesh, longest: float) -> TriangleMesh:
    """Return the same surface with inner edges no longer than `longest` [m], where boundary edges allow it.

    Old vertices keep their indices. Each round halves all long edges, so their number is the logarithm of the longest;
    a face at a boundary edge longer than twice the limit cannot meet it.
    """
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    for _ in range(int(np.ceil(np.log2(max(size / longest, 1.0)))) + 1):
        pair = edges(mesh)
        length = np.linalg.norm(mesh.vertices[pair[:, 0]] - mesh.vertices[pair[:, 1]], axis=1)
        halve = (length > longest) & (edge_faces(mesh)[:, 1] >= 0)
        if not halve.any():
            break
        middle_of_edge = np.full(len(pair), -1, dtype=np.int32)
        middle_of_edge[halve] = len(mesh.vertices) + np.arange(int(halve.sum()))
        vertices = np.vstack([mesh.vertices, mesh.vertices[pair[halve]].mean(axis=1)])
        mesh = TriangleMesh(vertices, _split_faces(mesh, middle_of_edge))
    return mesh


def _split_faces(mesh: TriangleMesh, middle_of_edge: IntArray) -> IntArray:
    """Return the faces after the marked edges are halved; by how many of its edges are, a face becomes 1 to 4."""
    halves = np.sort(half_edges(mesh), axis=1).astype(np.int64)
    key = halves[:, 0] * len(mesh.vertices) + halves[:, 1]
    edge_of_half = np.unique(key, return_inverse=True)[1]
    middle = middle_of_edge[edge_of_half].reshape(-1, 3)
    count = (middle >= 0).sum(axis=1)
    # Turn each face so that one halved edge comes first, or that of two the whole edge comes last.
    first = np.where(count == 2, (np.argmin(middle >= 0, axis=1) + 1) % 3, np.argmax(middle >= 0, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(mesh.faces, turn, axis=1).T
    ab, bc, ca = np.take_along_axis(middle, turn, axis=1).T
    one, two, three = count == 1, count == 2, count == 3
    pieces = [
        mesh.faces[count == 0],
        np.column_stack([a, ab, c])[one],
        np.column_stack([ab, b, c])[one],
        np.column_stack([ab, b, bc])[two],
        np.column_stack([a, ab, bc])[two],
        np.column_stack([a, bc, c])[two],
        np.column_stack([a, ab, ca])[three],
        np.column_stack([ab, b, bc])[three],
        np.column_stack([bc, c, ca])[three],
        np.column_stack([ab, bc, ca])[three],
    ]
    return np.vstack(pieces).astype(np.int32)
