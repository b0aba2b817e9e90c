"""Points spread over a surface."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import face_areas, face_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh


def sample_surface(mesh: TriangleMesh, count: int, seed: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return points evenly spread by area [m], their face normals, and their faces.

    Stratified along the faces in order, so that each face gets its share to within one point.

    Args:
        mesh: The surface.
        count: How many points.
        seed: Of the places within faces.

    Returns:
        Points (count, 3), unit normals (count, 3), faces (count,).
    """
    rng = np.random.default_rng(seed)
    cumulative = np.cumsum(face_areas(mesh))
    at = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    face = np.minimum(np.searchsorted(cumulative, at), len(mesh.faces) - 1)
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1.0 - root, root * (1.0 - second), root * second])
    points = np.einsum("nk,nkd->nd", weights, mesh.vertices[mesh.faces[face]])
    return points, face_normals(mesh)[face], face.astype(np.int32)
