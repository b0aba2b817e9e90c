"""Texture seams: where one vertex has several places in the picture."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart


def split_at_seams(mesh: TriangleMesh) -> tuple[IntArray, IntArray, FloatArray]:
    """Give each vertex one place in the picture, as renderers need it.

    Args:
        mesh: With texture coordinates.

    Returns:
        The old index of each new vertex, shape (W,); the faces with new indices, shape (F, 3); texture coordinates, v
        down as glTF has them, shape (W, 2). Vertices without a face are dropped.
    """
    assert mesh.texture is not None
    places = mesh.texture.reshape(-1, 2)
    order = np.lexsort((places[:, 1], places[:, 0], mesh.faces.reshape(-1)))
    rows = np.column_stack([mesh.faces.reshape(-1), places])[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    corner = np.empty(len(rows), dtype=np.int32)
    corner[order] = np.cumsum(first) - 1
    source = rows[first, 0].astype(np.int32)
    return source, corner.reshape(-1, 3), rows[first, 1:] * (1.0, -1.0) + (0.0, 1.0)


def cut_open(name: str, mesh: TriangleMesh, picture: ByteArray | None) -> GlbPart:
    """Return a mesh with texture coordinates, and its picture if it has one, as a part, with a vertex for each place.

    Its normals are those of the whole surface: vertices at one place share them, however the mesh was cut before.
    """
    source, faces, uv = split_at_seams(mesh)
    points, inverse = np.unique(mesh.vertices, axis=0, return_inverse=True)
    whole = inverse.reshape(-1).astype(np.int32)
    normals = vertex_normals(TriangleMesh(points, whole[mesh.faces]))
    colors = None if mesh.colors is None or picture is not None else mesh.colors[source]
    cut = TriangleMesh(mesh.vertices[source], faces, colors)
    return GlbPart(name, cut, normals=normals[whole[source]], uv=uv, texture=picture)
