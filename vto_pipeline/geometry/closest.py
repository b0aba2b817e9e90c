"""Points of a surface: the closest to each query, and where in its triangle a point lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray


def closest_points(
    points: FloatArray, vertices: FloatArray, faces: IntArray
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Return face, closest point and distance [m] for each point."""
    import igl

    squared, face, closest = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.int64)
    )
    return np.asarray(face).astype(np.int64), np.asarray(closest), np.sqrt(np.asarray(squared))


def barycentric(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the shares of a triangle's corners in a point of it, shape (N, 3) (Ericson 2004, 3.4)."""
    a, b, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    pa, pb = (p * a).sum(1), (p * b).sum(1)
    scale = aa * bb - ab * ab + 1e-30
    v, w = (bb * pa - ab * pb) / scale, (aa * pb - ab * pa) / scale
    return np.stack([1 - v - w, v, w], axis=1)
