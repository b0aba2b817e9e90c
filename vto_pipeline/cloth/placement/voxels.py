"""A mesh as a solid of cubes: those whose centre it winds around.

How often a closed surface winds around a point is how often a ray from there leaves it, less how often it enters. So
each triangle counts in the columns of cubes that it is above.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import half_edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def solid_cubes(mesh: TriangleMesh, low: FloatArray, cube: float) -> NDArray[np.bool_]:
    """Return which cubes have their centre inside a mesh, whichever way it is oriented, shape (X, Y, Z).

    Of one that is not closed, by Barill, Dickson, Schmidt, Levin & Jacobson 2018, "Fast winding numbers for soups and
    clouds".

    Args:
        mesh: The surface [m]; of one that is not closed, what it winds around more than half.
        low: Where the cubes begin [m], shape (3,), not above the mesh.
        cube: Their sides [m].
    """
    counts = np.ceil((mesh.vertices.max(axis=0) - low) / cube).astype(np.int64) + 1
    if _is_closed(mesh):
        left = np.zeros(counts, np.int32)
        _count_above((mesh.vertices - low) / cube - 0.5, mesh.faces, left)
        return np.cumsum(left[:, :, ::-1], axis=2)[:, :, ::-1] != 0
    import igl

    centres = low + cube * (np.indices(counts).reshape(3, -1).T + 0.5)
    around = igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), centres)
    return np.abs(around).reshape(counts) > 0.5


def _is_closed(mesh: TriangleMesh) -> bool:
    """Return whether the sides of its triangles cancel: each is gone along as often one way as the other."""
    start, end = half_edges(mesh).T.astype(np.int64)
    size = len(mesh.vertices)
    return np.array_equal(np.sort(start * size + end), np.sort(end * size + start))


@njit(cache=True, error_model="numpy")
def _count_above(vertices, faces, left):  # type: ignore[no-untyped-def]
    """Count the triangles above each centre, in the highest one below: 1 those that a ray leaves through, -1 others.

    Args:
        vertices: In sides of cubes from the first centre, shape (V, 3).
        faces: Shape (F, 3).
        left: Changed in place, shape (X, Y, Z).
    """
    for f in range(len(faces)):
        i, j, k = faces[f]
        a, b, c = vertices[i], vertices[j], vertices[k]
        x0, x1 = max(np.ceil(min(a[0], b[0], c[0])), 0.0), np.floor(max(a[0], b[0], c[0]))
        y0, y1 = max(np.ceil(min(a[1], b[1], c[1])), 0.0), np.floor(max(a[1], b[1], c[1]))
        for x in range(int(x0), int(x1) + 1):
            for y in range(int(y0), int(y1) + 1):
                of_c, side_c = _side(vertices, i, j, x, y)
                of_a, side_a = _side(vertices, j, k, x, y)
                of_b, side_b = _side(vertices, k, i, x, y)
                area = of_a + of_b + of_c
                if side_a == side_b == side_c and area != 0.0:
                    z = min(np.ceil((of_a * a[2] + of_b * b[2] + of_c * c[2]) / area) - 1.0, left.shape[2] - 1.0)
                    if z >= 0.0:
                        left[x, y, int(z)] += side_a


@njit(cache=True, error_model="numpy")
def _side(vertices, i, j, x, y):  # type: ignore[no-untyped-def]
    """Return twice the area of (x, y) with an edge seen from above, and the side of the edge that it is on, -1 or 1.

    On the edge, the side is that of a place beside it, the same for both triangles: the ray meets one of them.
    """
    first, last = min(i, j), max(i, j)
    along_x, along_y = vertices[last, 0] - vertices[first, 0], vertices[last, 1] - vertices[first, 1]
    area = along_x * (y - vertices[first, 1]) - along_y * (x - vertices[first, 0])
    beside = area if area != 0.0 else -along_y if along_y != 0.0 else along_x
    turn = 1 if i == first else -1
    return turn * area, turn if beside > 0.0 else -turn
