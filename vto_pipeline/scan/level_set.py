"""A truncated signed distance field on sparse voxels, and its zero level set."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.scan.canonical import canonical_mesh
from vto_pipeline.scan.depth_views import DepthViews

BLOCK, SEEN_STRIDE = 16, 4
"""Open3D opens blocks of 16³ voxels for every fourth pixel, and fails when none of those has a reading."""

SPARE = 1.2
"""Blocks reserved for each one that a sample of the maps needs; Open3D takes three times the memory to make more."""

DEPTH_SCALE = 1.0
"""Depth is in metres."""

_PIXEL_VOXELS = BLOCK / SEEN_STRIDE


def count_blocks(views: DepthViews, voxel: float, reach: float) -> int:
    """Blocks of voxels that all maps together may need, from a sample of them.

    Args:
        views: The maps.
        voxel: Side of a voxel [m].
        reach: Of the distance field, in voxels.
    """
    grid = _grid(voxel, 1)
    posed = [_posed(grid, views, index, depth, voxel, reach) for index, depth in views.depths(views.sample())]
    seen = [view[0].numpy() for view in posed if view is not None]
    return round(SPARE * len(np.unique(np.concatenate(seen), axis=0))) if seen else 1


def level_set(views: DepthViews, voxel: float, blocks: int, reach: float, min_views: int, job: Job) -> TriangleMesh:
    """Integrate all maps (Curless and Levoy 1996) and extract the zero level set.

    Args:
        views: The maps.
        voxel: Side of a voxel [m].
        blocks: To reserve.
        reach: Of the distance field, in voxels.
        min_views: Maps that must have seen a place.
        job: Receives progress, map by map.

    Raises:
        ScanError: no surface came out.
    """
    import cv2
    import open3d as o3d

    core: Any = o3d.core
    grid = _grid(voxel, blocks)
    fused = far = readings = 0
    for index, depth in views.depths():
        camera = views.intrinsics[index]
        readings += int(np.count_nonzero(depth))
        far += int((depth > _farthest(camera, voxel)).sum())
        view = _posed(grid, views, index, depth, voxel, reach)
        if view is None:
            job.note(f"{views.names[index]}: {np.count_nonzero(depth)} readings are too few to fuse")
        else:
            fused += 1
            seen, picture, matrix, inverse, limit = view
            size = (camera.width, camera.height)
            shade = cv2.resize(views.color_of(index), size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
            color = o3d.t.geometry.Image(core.Tensor(shade))
            grid.integrate(seen, picture, color, matrix, inverse, DEPTH_SCALE, limit, reach)
        job.progress(0.8 * (index + 1) / len(views.names), f"fusing view {index + 1} of {len(views.names)}")
    if not readings:
        raise ScanError(f"none of {len(views.names)} depth maps holds a reading", hint="is depth_scale right?")
    if far:
        job.note(f"left out {far} readings so far away that their pixels are larger than {_PIXEL_VOXELS:.0f} voxels")
    surface = None
    if fused >= min_views:
        surface = grid.extract_triangle_mesh(min_views - 0.5)  # Open3D keeps what weighs more; a view weighs 1
    if surface is None or "indices" not in surface.triangle or len(surface.triangle.indices) == 0:
        hint = "are the poses right? lower min_views, or take more overlapping views"
        raise ScanError(f"no surface was seen by {min_views} of {len(views.names)} views", hint=hint)
    colors = np.clip(np.round(255 * surface.vertex.colors.numpy()), 0, 255).astype(np.uint8)
    return canonical_mesh(surface.vertex.positions.numpy().astype(float), surface.triangle.indices.numpy(), colors)


def _farthest(camera: Intrinsics, voxel: float) -> float:
    """Depth [m] beyond which the blocks that Open3D opens no longer touch each other."""
    return _PIXEL_VOXELS * voxel * camera.fx


def _grid(voxel: float, blocks: int) -> Any:
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    names, channels = ("tsdf", "weight", "color"), tuple(map(core.SizeVector, ([1], [1], [3])))
    types = (core.float32,) * 3
    return o3d.t.geometry.VoxelBlockGrid(names, types, channels, voxel, BLOCK, blocks, core.Device("CPU:0"))


def _posed(
    grid: Any, views: DepthViews, index: int, depth: NDArray[np.float32], voxel: float, reach: float
) -> tuple[Any, ...] | None:
    """Blocks, depth image, camera matrix, camera from world and largest depth of a view; None if nothing is seen."""
    import open3d as o3d

    core: Any = o3d.core
    camera = views.intrinsics[index]
    values = np.where(depth < _farthest(camera, voxel), depth, np.float32(0))
    if not values[::SEEN_STRIDE, ::SEEN_STRIDE].any():
        return None
    picture, limit = o3d.t.geometry.Image(core.Tensor(values)), float(values.max()) + voxel
    matrix, inverse = core.Tensor(camera.matrix), core.Tensor(np.linalg.inv(views.world_from_cam[index]))
    blocks = grid.compute_unique_block_coordinates(picture, matrix, inverse, DEPTH_SCALE, limit, reach)
    return blocks, picture, matrix, inverse, limit
