"""How far a surface may be off where there is no truth: how far either half of the depth maps that saw it says it is.

Maps taken one after the other share most of their errors: of light, slant, and where the camera is thought to be. The
first and the second half of those that saw a place share few. Where a surface lies in the middle of both, half of their
difference is its standard error (batch means; Conway 1963), and that is how far it lies from either.

A map's reading of a place is the mean of those around it: a surface is made from the readings of an area, too.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.depth_views import DepthViews

REACH = 6.0
"""Readings farther from a surface are of another [edge lengths]; an edge is two thirds of a voxel."""
PLACES = 10_000
"""Of the surface that are asked for, evenly among its vertices."""
QUANTILES = {"median": 0.5, "p95": 0.95}


def predicted_error(
    views: DepthViews, surface: TriangleMesh, metres_per_unit: float = 1.0, filled_share: float = 0.0
) -> dict[str, float | None] | None:
    """Return the median and the 95th percentile of a surface's distances from halves of its maps, along normals [mm].

    What all maps have in common is not in it: the scale, and how the scan is placed. What was filled counts as farther
    off than all that was seen.

    Args:
        views: Posed depth maps, in the order in which they were taken.
        surface: Made from them, in their unit.
        metres_per_unit: Of both.
        filled_share: Of the finished surface, what no map saw.

    Returns:
        None where no map has a reading on it; a quantile is None where it lies among what was filled.
    """
    reach = REACH * float(np.median(edge_lengths(surface)))
    around = neighbour_mean(surface)[np.unique(np.linspace(0, len(surface.vertices) - 1, PLACES).round().astype(int))]
    read = np.unique(around.indices)
    points, normals, around = surface.vertices[read], vertex_normals(surface)[read], around[:, read]
    readings = np.empty((len(views.names), around.shape[0]), np.float32)
    for index, depth in views.depths():
        pose, found = np.ascontiguousarray(views.world_from_cam[index]), np.full(len(read), np.nan)
        _read(points, normals, depth, views.intrinsics[index].matrix, pose, reach, found)
        readings[index] = around @ found
    away = _halves_away(readings)
    if len(away) == 0:
        return None
    seen, scale = 1.0 - filled_share, 1e3 * metres_per_unit
    return {
        name: round(scale * float(np.quantile(away, q / seen)), 3) if q < seen else None
        for name, q in QUANTILES.items()
    }


def _halves_away(readings: NDArray[np.float32]) -> FloatArray:
    """Return how far the halves of the readings (C, N) of each place are off in their means [m], one or two a place."""
    known = np.isfinite(readings)
    rank, count = np.cumsum(known, axis=0), known.sum(axis=0)
    early = known & (rank <= (count + 1) // 2)
    away = []
    for half in (early, known & ~early):
        number = half.sum(axis=0)
        total = np.sum(readings, axis=0, where=half, dtype=float)
        away.append(np.abs(total[number > 0] / number[number > 0]))
    return np.concatenate(away)


@njit(cache=True, nogil=True)
def _read(points, normals, depth, matrix, world_from_cam, reach, found):  # type: ignore[no-untyped-def]  # Numba
    """Write a map's signed distances from points along their normals, where it is known on all four sides of a point.

    What is nearer to the camera is positive.
    """
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
            found[n] = (measured / w - 1.0) * along
