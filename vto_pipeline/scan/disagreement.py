"""How far a surface may be off where there is no truth: how far each depth map that saw it says that it is.

A map is a measurement of its own, from its own side. Maps of neighbouring photos share some of their errors, so that
their mean is hardly better than one of them: its distances from the surface stand for the surface's own.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.depth_views import DepthViews

REACH = 6.0
"""Readings farther from a surface are of another [edge lengths]; an edge is two thirds of a voxel."""
BINS = 4000
"""Distances are counted in so many steps up to the reach."""
QUANTILES = {"median": 0.5, "p95": 0.95}


def predicted_error(
    views: DepthViews, surface: TriangleMesh, metres_per_unit: float = 1.0, filled_share: float = 0.0
) -> dict[str, float | None] | None:
    """Return the median and the 95th percentile of the maps' distances from a surface, along its normals [mm].

    What all maps have in common is not in it: the scale, and how the scan is placed. What was filled counts as farther
    off than all that was seen.

    Args:
        views: Posed depth maps.
        surface: Made from them, in their unit.
        metres_per_unit: Of both.
        filled_share: Of the finished surface, what no map saw.

    Returns:
        None where no map has a reading on it; a quantile is None where it lies among what was filled.
    """
    reach = REACH * float(np.median(edge_lengths(surface)))
    normals, counts = vertex_normals(surface), np.zeros(BINS, np.int64)
    for index, depth in views.depths():
        pose = np.ascontiguousarray(views.world_from_cam[index])
        _count(surface.vertices, normals, depth, views.intrinsics[index].matrix, pose, reach, counts)
    if not counts.any():
        return None
    share = (1.0 - filled_share) * np.cumsum(counts) / counts.sum()
    step = 1e3 * metres_per_unit * reach / BINS
    found = {name: int(np.searchsorted(share, q)) for name, q in QUANTILES.items()}
    return {name: round(step * (k + 0.5), 3) if k < BINS else None for name, k in found.items()}


@njit(cache=True, nogil=True)
def _count(points, normals, depth, matrix, world_from_cam, reach, counts):  # type: ignore[no-untyped-def]  # Numba
    """Count a map's distances from points along their normals, where the map is known on all four sides of a point."""
    height, width = depth.shape
    turn, eye = world_from_cam[:3, :3], world_from_cam[:3, 3]
    for n in range(len(points)):
        x, y, z = points[n, 0] - eye[0], points[n, 1] - eye[1], points[n, 2] - eye[2]
        w = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
        along = normals[n, 0] * x + normals[n, 1] * y + normals[n, 2] * z
        if w <= 0 or along >= 0:  # behind the camera, or seen from behind
            continue
        u = matrix[0, 0] * (turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z) / w + matrix[0, 2]
        v = matrix[1, 1] * (turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z) / w + matrix[1, 2]
        column, row = int(np.floor(u)), int(np.floor(v))
        if column < 0 or row < 0 or column + 1 >= width or row + 1 >= height:
            continue
        corners = depth[row : row + 2, column : column + 2]
        if corners.min() <= 0 or corners.max() - corners.min() > reach:
            continue
        s, t = u - column, v - row
        upper = (1 - s) * corners[0, 0] + s * corners[0, 1]
        lower = (1 - s) * corners[1, 0] + s * corners[1, 1]
        measured = (1 - t) * upper + t * lower
        if abs(measured - w) < reach:
            away = abs((measured / w - 1.0) * along)
            counts[min(int(away / reach * len(counts)), len(counts) - 1)] += 1
