"""A closed surface through confirmed depths: where nothing was measured, the truth is not far from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.canonical import canonical_mesh
from vto_pipeline.scan.library_message import library_message
from vto_pipeline.scan.photos.consistency import rays

STRIDE = 2
"""Every second row and column is enough, or fewer: neighbours repeat each other, and photos see the same places."""
MOST_POINTS = 2_000_000
"""Before they are thinned; 0.1 GB."""
CELL_PX = 3.0
"""Points are averaged in cells of so many pixels on the surface, and the surface resolves twice that."""
JUMP = 0.02
"""Neighbouring depths that differ by more are not one surface [share]."""


def guess_surface(maps: DepthMaps, pixel: float) -> tuple[TriangleMesh, FloatArray]:
    """Close the gaps between the depth maps smoothly.

    Kazhdan and Hoppe 2013 (screened Poisson), by Open3D, solved by one thread so that it is reproducible.

    Args:
        maps: Confirmed depths.
        pixel: Side of a pixel on the surface [m].

    Returns:
        The surface, in the maps' frame, and the points that it was drawn through, shape (N, 3).

    Raises:
        ScanError: too little depth for a surface.
    """
    import open3d as o3d

    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    known = sum(int(np.count_nonzero(depth)) for depth in maps.depth)
    stride = max(STRIDE, int(np.ceil(np.sqrt(known / MOST_POINTS))))
    found = list(in_order(lambda index: _oriented(maps, index, stride), len(maps.names)))
    points, normals = _thinned(np.concatenate([p for p, _ in found]), np.concatenate([n for _, n in found]), pixel)
    if len(points) < 100:
        raise ScanError(f"{len(points)} points of confirmed depth are no surface")
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    width = 2 * CELL_PX * pixel
    try:
        solved, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, width=width, n_threads=1)
    except RuntimeError as error:
        raise ScanError(f"no surface through {len(points)} points: {library_message(error)}") from error
    return canonical_mesh(np.asarray(solved.vertices), np.asarray(solved.triangles), None), points


def _oriented(maps: DepthMaps, index: int, stride: int) -> tuple[FloatArray, FloatArray]:
    """Points of one map and their normals towards the camera, shapes (N, 3), where all neighbours are known."""
    lens = maps.intrinsics[index]
    depth = maps.depth[index, : lens.height, : lens.width].astype(np.float64)
    local = rays(lens.matrix, *depth.shape) * depth[..., None]
    middle = depth[1:-1, 1:-1]
    sides = np.stack([depth[1:-1, 2:], depth[1:-1, :-2], depth[2:, 1:-1], depth[:-2, 1:-1]])
    whole = (middle > 0) & (sides > 0).all(axis=0) & (np.abs(sides - middle) <= JUMP * middle).all(axis=0)
    row, column = stride * np.stack(np.nonzero(whole[1::stride, 1::stride])) + 1
    normal = np.cross(
        local[row + 1, column + 2] - local[row + 1, column], local[row + 2, column + 1] - local[row, column + 1]
    )
    point = local[row + 1, column + 1]
    normal *= -np.sign((normal * point).sum(axis=1, keepdims=True))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    pose = maps.world_from_cam[index]
    return point @ pose[:3, :3].T + pose[:3, 3], normal @ pose[:3, :3].T


def _thinned(points: FloatArray, normals: FloatArray, pixel: float) -> tuple[FloatArray, FloatArray]:
    """Mean point and mean normal of each occupied cell."""
    if len(points) == 0:
        return points, normals
    cell = np.floor((points - points.min(axis=0)) / (CELL_PX * pixel)).astype(np.int64)
    size = cell.max(axis=0) + 1
    _, which, count = np.unique(
        (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2], return_inverse=True, return_counts=True
    )

    def mean(values: FloatArray) -> FloatArray:
        return np.column_stack([np.bincount(which, values[:, k]) for k in range(3)]) / count[:, None]

    middle, normal = mean(points), mean(normals)
    length = np.linalg.norm(normal, axis=1)
    sure: NDArray[np.bool_] = np.asarray(length > 0.5)  # of both sides of thin cloth, neither
    return middle[sure], normal[sure] / length[sure, None]
