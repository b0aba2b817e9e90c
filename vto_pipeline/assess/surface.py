"""Sums over a surface: areas of faces and vertices, and face values carried to vertices."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray


def face_areas(positions: FloatArray, faces: IntArray) -> FloatArray:
    """Return the area of each face [m²], shape (F,)."""
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def vertex_areas(areas: FloatArray, faces: IntArray, count: int) -> FloatArray:
    """Return a third of the area of each vertex's faces [m²], shape (count,)."""
    return np.bincount(faces.ravel(), np.repeat(areas, 3), count) / 3.0


def to_vertices(per_face: FloatArray, areas: FloatArray, faces: IntArray, count: int) -> FloatArray:
    """Return the area-weighted mean over each vertex's faces, shape (count,); 0 where a vertex has no area."""
    total = vertex_areas(areas, faces, count)
    summed = vertex_areas(areas * per_face, faces, count)
    return np.divide(summed, total, out=np.zeros(count), where=total > 0.0)
