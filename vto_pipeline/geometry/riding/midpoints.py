"""Every triangle in four, by the middles of its edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.geometry.topology import edges, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh


def split_edges(mesh: TriangleMesh) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh with a vertex in the middle of each edge, and the two vertices that each lies between, or is.

    Args:
        mesh: V vertices and E edges.

    Returns:
        V + E vertices, those of the mesh first, and four times the faces; ends, shape (V + E, 2).
    """
    count, known = len(mesh.vertices), edges(mesh).astype(np.int64)
    halves = np.sort(half_edges(mesh), axis=1).astype(np.int64)
    number = np.searchsorted(known[:, 0] * count + known[:, 1], halves[:, 0] * count + halves[:, 1])
    middle = (count + number).reshape(-1, 3)  # of the edges from each corner to the next
    a, b, c = mesh.faces.T
    ab, bc, ca = middle.T
    faces = np.concatenate([np.column_stack(f) for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    ends = np.vstack([np.column_stack([np.arange(count)] * 2), known])
    return TriangleMesh(mesh.vertices[ends].mean(axis=1), faces), ends.astype(np.int32)


def split_in_four(mesh: TriangleMesh) -> TriangleMesh:
    """Return the mesh as `split_edges` does, with its colours and places in a picture."""
    fine, ends = split_edges(mesh)
    colors = None if mesh.colors is None else np.rint(mesh.colors[ends].mean(axis=1)).astype(np.uint8)
    texture = None if mesh.texture is None else _split_corners(mesh.texture)
    skin = None if mesh.skin is None else replace(mesh.skin, places=_split_corners(mesh.skin.places))
    return replace(mesh, vertices=fine.vertices, faces=fine.faces, colors=colors, texture=texture, skin=skin)


def _split_corners(corners: FloatArray) -> FloatArray:
    """Return the corners of triangles (F, 3, D) split in four, shape (4F, 3, D), in the order of `split_edges`."""
    a, b, c = corners.transpose(1, 0, 2)
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
