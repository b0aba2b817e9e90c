"""Normals of triangles, and how much two of them fold. Scalars, for speed."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def triangle_normal(points, i, k, j):  # type: ignore[no-untyped-def]
    """Return the unit normal of a triangle, zero if it has no area, and its area."""
    ux, uy, uz = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1], points[k, 2] - points[i, 2]
    vx, vy, vz = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = np.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    return x / length, y / length, z / length, 0.5 * length


@njit(cache=True)
def fold_to(x, y, z, normal):  # type: ignore[no-untyped-def]
    """Return one less the cosine between two unit normals."""
    return 1.0 - (x * normal[0] + y * normal[1] + z * normal[2])
