"""Cutting a mesh along the zero level of a function of its vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

SNAP = 0.25  # a cut this close to a vertex, in shares of the edge, moves the vertex instead


def clip_snapped(mesh: TriangleMesh, values: FloatArray) -> TriangleMesh:
    """Keep the part of a mesh where `values` is positive; triangles on the border are cut.

    Args:
        mesh: The mesh.
        values: One per vertex, shape (V,); the border is their linear zero level.

    Returns:
        The kept part without unused vertices. Slivers at the border are avoided by moving vertices onto it.
    """
    vertices, values = _snap(mesh.vertices, mesh.faces, values)
    positive = values > 0.0
    kept = positive[mesh.faces].sum(axis=1)
    faces = [mesh.faces[_inside(values, mesh.faces)]]
    crossing = mesh.faces[(kept > 0) & ~_inside(values, mesh.faces)]

    lone = np.where(positive[crossing].sum(axis=1) == 1, positive[crossing].T, ~positive[crossing].T).argmax(axis=0)
    turned = np.take_along_axis(crossing, (lone[:, None] + np.arange(3)) % 3, axis=1)
    apex, left, right = turned.T
    edges = np.sort(np.concatenate([turned[:, [0, 1]], turned[:, [0, 2]]]), axis=1)
    edges, where = np.unique(edges, axis=0, return_inverse=True)
    a, b = values[edges].T
    share = (a / np.where(a == b, 1.0, a - b))[:, None]
    points = (1.0 - share) * vertices[edges[:, 0]] + share * vertices[edges[:, 1]]
    to_left, to_right = (where.reshape(2, -1) + len(vertices)).astype(np.int32)

    to_left = np.where(values[left] == 0.0, left, to_left)
    to_right = np.where(values[right] == 0.0, right, to_right)
    alone = positive[apex]
    tip = np.stack([apex, to_left, to_right], axis=1)[alone]
    base = np.stack([left, right, to_right, left, to_right, to_left], axis=1)[~alone].reshape(-1, 3)
    faces += [tip, base]
    return compact(np.concatenate([vertices, points]), np.concatenate(faces))


def compact(vertices: FloatArray, faces: IntArray) -> TriangleMesh:
    """Drop triangles with a repeated corner, then vertices that no triangle uses."""
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    used, renumbered = np.unique(faces[distinct], return_inverse=True)
    return TriangleMesh(vertices[used], renumbered.reshape(-1, 3).astype(np.int32))


def _inside(values: FloatArray, faces: IntArray) -> NDArray[np.bool_]:
    """Triangles with no corner beyond the border and at least one before it."""
    corner = values[faces]
    lowest, highest = corner.min(axis=1), corner.max(axis=1)
    return (lowest >= 0.0) & (highest > 0.0)


def _snap(vertices: FloatArray, faces: IntArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Move each vertex close to the border onto it, along the crossing edge that is nearest."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])
    a, b = values[ends].T
    share = np.where((a > 0.0) != (b > 0.0), a / np.where(a == b, 1.0, a - b), 1.0)
    order = np.lexsort((ends[:, 1], share, ends[:, 0]))
    first = order[np.unique(ends[order, 0], return_index=True)[1]]
    near = first[share[first] < SNAP]
    moved, target = ends[near].T
    vertices, values = vertices.copy(), values.copy()
    vertices[moved] += share[near, None] * (vertices[target] - vertices[moved])
    values[moved] = 0.0
    return vertices, values
