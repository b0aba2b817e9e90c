"""A mesh as a solid of cubes: those whose centre it winds around.

Off a closed surface the winding number is the same all about a point, and from cube to cube where none is cut. So it is
computed for the cubes that the surface may cut, and for one of each region that these leave.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from vto_pipeline.geometry.topology import half_edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def solid_cubes(mesh: TriangleMesh, low: FloatArray, cube: float) -> NDArray[np.bool_]:
    """Return which cubes have their centre inside a mesh, whichever way it is oriented, shape (X, Y, Z).

    After Barill, Dickson, Schmidt, Levin & Jacobson 2018, "Fast winding numbers for soups and clouds".

    Args:
        mesh: The surface [m]; of one that is not closed, what it winds around more than half.
        low: Where the cubes begin [m], shape (3,), not above the mesh.
        cube: Their sides [m].
    """
    import igl

    counts = np.ceil((mesh.vertices.max(axis=0) - low) / cube).astype(np.int64) + 1
    cut = np.zeros(counts, np.bool_)
    if _is_closed(mesh):
        _mark_boxes((mesh.vertices - low) / cube, mesh.faces, cut)
    else:
        cut[:] = True
    regions, count = ndimage.label(~cut)  # 0: those cut
    one_of = np.zeros(count + 1, np.int64)
    one_of[regions.reshape(-1)] = np.arange(cut.size)
    asked = np.union1d(np.flatnonzero(cut), one_of)
    centres = low + cube * (np.column_stack(np.unravel_index(asked, counts)) + 0.5)
    inside = np.zeros(cut.size, np.bool_)
    inside[asked] = np.abs(igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), centres)) > 0.5
    return np.where(cut, inside.reshape(counts), inside[one_of][regions])


def _is_closed(mesh: TriangleMesh) -> bool:
    """Return whether the sides of its triangles cancel: each is gone along as often one way as the other."""
    start, end = half_edges(mesh).T.astype(np.int64)
    size = len(mesh.vertices)
    return np.array_equal(np.sort(start * size + end), np.sort(end * size + start))


@njit(cache=True)
def _mark_boxes(vertices, faces, cut):  # type: ignore[no-untyped-def]
    """Mark the cubes that a triangle's box meets; vertices in sides of cubes, shape (V, 3)."""
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        x0, x1 = int(min(a[0], b[0], c[0])), int(max(a[0], b[0], c[0]))
        y0, y1 = int(min(a[1], b[1], c[1])), int(max(a[1], b[1], c[1]))
        z0, z1 = int(min(a[2], b[2], c[2])), int(max(a[2], b[2], c[2]))
        cut[x0 : x1 + 1, y0 : y1 + 1, z0 : z1 + 1] = True
