"""Texture seams: where one vertex has several places in the picture."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.texture import TexturedMesh


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
    order = np.lexsort([places[:, 1], places[:, 0], mesh.faces.reshape(-1)])
    rows = np.column_stack([mesh.faces.reshape(-1), places])[order]
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (rows[1:] != rows[:-1]).any(axis=1)
    corner = np.empty(len(rows), dtype=np.int32)
    corner[order] = np.cumsum(first) - 1
    source = rows[first, 0].astype(np.int32)
    return source, corner.reshape(-1, 3), rows[first, 1:] * (1.0, -1.0) + (0.0, 1.0)


def textured_part(name: str, textured: TexturedMesh) -> GlbPart:
    """Return a mesh and its picture as a part, cut open where the picture is."""
    mesh = textured.mesh
    source, faces, uv = split_at_seams(mesh)
    return GlbPart(
        name,
        TriangleMesh(mesh.vertices[source], faces),
        normals=vertex_normals(mesh)[source],
        uv=uv,
        texture=textured.picture,
    )
