"""One surface from many depth maps: a truncated signed distance field on sparse voxels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.geometry.topology import component_areas
from vto_pipeline.io.captures.depth import read_depth
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import DepthFrameSet, DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.canonical import canonical_mesh, drop_small_pieces, drop_vertices
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.library_message import library_message
from vto_pipeline.scan.photos.consistency import views_on_surface
from vto_pipeline.scan.photos.coverage import covered_share

GREY = 200
"""Colour of a surface without photos."""

BLOCK, SEEN_STRIDE = 16, 4
"""Open3D opens blocks of 16³ voxels for every fourth pixel, and fails when none of those has a reading."""

DEPTH_SCALE = 1.0
"""Depth is in metres."""

_PIXEL_VOXELS = BLOCK / SEEN_STRIDE

MAX_BLOCKS = 20_000
"""1.6 GB of distances, weights and colours; a scene that needs more gets coarser voxels."""


class FuseConfig(Config):
    """Settings of the fusion."""

    voxel_mm: float | None = Field(None, gt=0.1, le=100, description="Side of a voxel; default from pixels [mm]")
    voxel_pixels: float = Field(1.5, gt=0.2, le=10, description="The default voxel, in pixels seen on the surface")
    truncation_voxels: float = Field(4.0, ge=2, le=16, description="Reach of the distance field, in voxels")
    min_views: int = Field(2, ge=1, le=100, description="Depth maps that must agree with the surface at a vertex")
    support_voxels: float = Field(1.5, gt=0, le=16, description="Distance within which maps agree, in voxels")
    min_piece: float = Field(0.01, ge=0, le=1, description="Smallest piece kept, as a share of the largest's area")


class PhotoFuseConfig(FuseConfig):
    """Settings of the fusion of photos."""

    min_coverage: float = Field(0.25, ge=0, le=1, description="Least share of the seen region that has depth")


SCRAPS = (
    "plain or glossy things need a pattern, matt spray or even light, and photos 10 to 15 degrees apart; on a "
    "turntable, cover what does not turn; avoid prints that repeat; a depth camera needs no texture; a lower "
    "min_coverage accepts the surface as it is"
)


def fuse_depth_maps(
    photos: PhotoSet, cameras: CameraSet, maps: DepthMaps, config: FuseConfig, job: Job
) -> TriangleMesh:
    """Fuse the depth maps of photos into a surface with the photos' colours.

    Args:
        photos: The photos, for their colours.
        cameras: That took them, with their distortion.
        maps: Their depth, after undistortion.
        config: Settings.
        job: Receives progress, view by view.

    Returns:
        Surface [m], open where nothing was seen.

    Raises:
        ScanError: no surface came out.
    """
    paths = {path.name: path for path in photos.paths}
    lenses = dict(zip(cameras.names, cameras.intrinsics, strict=True))

    def color_of(index: int) -> ByteArray:
        name = maps.names[index]
        return undistorted(read_image(paths[name]), lenses[name])

    return _fuse(maps, color_of, config, job)


def check_coverage(
    surface: TriangleMesh, maps: DepthMaps, cloud: PointCloud, config: PhotoFuseConfig, job: Job
) -> None:
    """Refuse a surface that covers too little of what the photos see.

    Args:
        surface: Of these maps.
        maps: Depth that several photos confirm.
        cloud: Sparse points in the same frame, which tell what the photos see.
        config: Settings.
        job: Receives the share covered and the share of the largest piece.

    Raises:
        ScanError: too little is covered; the surface is its partial result.
    """
    coverage = covered_share(maps, cloud)
    _, area = component_areas(surface)
    largest = float(area.max() / area.sum())
    job.measure(coverage=round(coverage, 3), largest_piece_share=round(largest, 3))
    if coverage < config.min_coverage:
        covered = f"the surface covers {100 * coverage:.1f} % of what the photos see between their matched points"
        pieces = f"the largest of its {len(area)} pieces is {100 * largest:.0f} % of it"
        problem = f"{covered}; at least {100 * config.min_coverage:.0f} % is needed; {pieces}"
        raise ScanError(problem, hint=SCRAPS, partial={"surface": surface})


def fuse_depth_frames(frames: DepthFrameSet, world_from_cam: FloatArray, config: FuseConfig, job: Job) -> TriangleMesh:
    """Fuse the frames of a depth camera into a surface.

    Args:
        frames: Depth, and colour if there is any.
        world_from_cam: Poses [m], shape (N, 4, 4).
        config: Settings.
        job: Receives progress, frame by frame.

    Returns:
        Surface [m], open where nothing was seen.

    Raises:
        ScanError: no surface came out.
    """
    camera, count = frames.intrinsics, len(frames.depth_paths)
    depth = np.stack([clean_depth(read_depth(path, frames.depth_scale), camera) for path in frames.depth_paths])
    maps = DepthMaps(tuple(path.name for path in frames.depth_paths), (camera,) * count, world_from_cam, depth)
    plain = np.full((camera.height, camera.width, 3), GREY, np.uint8)
    return _fuse(
        maps, lambda index: read_image(frames.color_paths[index]) if frames.color_paths else plain, config, job
    )


def undistorted(picture: ByteArray, camera: Intrinsics) -> ByteArray:
    """Return a picture, shape (H, W, 3), as the same camera without distortion would have taken it; black beyond it."""
    import cv2

    if camera.k1 == 0.0:
        return picture
    return np.asarray(cv2.undistort(picture, camera.matrix, np.array([camera.k1, 0.0, 0.0, 0.0])), dtype=np.uint8)


def _fuse(maps: DepthMaps, color_of: Callable[[int], ByteArray], config: FuseConfig, job: Job) -> TriangleMesh:
    """Extract the surface, and keep what the depth maps lie on.

    A sheet of cloth seen from both sides leaves false sheets a truncation away on either side, where one side's free
    space meets the other's unknown; no depth map lies on those.
    """
    readings = maps.depth > 0
    if not readings.any():
        raise ScanError(f"none of {len(maps.names)} depth maps holds a reading", hint="is depth_scale right?")
    voxel = config.voxel_mm / 1000 if config.voxel_mm else config.voxel_pixels * _pixel_on_surface(maps)
    wish = voxel
    while (blocks := _count_blocks(maps, voxel, config.truncation_voxels)) > MAX_BLOCKS:
        voxel *= max(1.05, np.sqrt(blocks / MAX_BLOCKS))  # a surface meets 1 / side² of them
    if voxel > wish:
        problem = f"voxels of {1000 * voxel:.3g} mm instead of {1000 * wish:.3g} mm, so that all fit in memory"
        job.warn(f"{problem}; leave out what is not the object")
    far = sum(int((depth > _farthest(c, voxel)).sum()) for depth, c in zip(maps.depth, maps.intrinsics, strict=True))
    if far:
        job.note(f"left out {far} readings so far away that their pixels are larger than {_PIXEL_VOXELS:.0f} voxels")
    try:
        mesh = _level_set(maps, color_of, voxel, blocks, config, job)
    except RuntimeError as error:
        raise ScanError(f"the depth maps could not be fused: {library_message(error)}") from error
    views = views_on_surface(mesh.vertices, maps, config.support_voxels * voxel)
    mesh = drop_small_pieces(drop_vertices(mesh, views < config.min_views), config.min_piece, job)
    job.measure(voxel_mm=round(1000 * voxel, 3), points=len(mesh.vertices), triangles=len(mesh.faces))
    return mesh


def _pixel_on_surface(maps: DepthMaps) -> float:
    """Side of a pixel on the surface [m], the median over all maps."""
    sizes = [np.median(d[d > 0]) / c.fx for d, c in zip(maps.depth, maps.intrinsics, strict=True) if d.any()]
    return float(np.median(sizes))


def _farthest(camera: Intrinsics, voxel: float) -> float:
    """Depth [m] beyond which the blocks that Open3D opens no longer touch each other."""
    return _PIXEL_VOXELS * voxel * camera.fx


def _count_blocks(maps: DepthMaps, voxel: float, reach: float) -> int:
    """Blocks of voxels that all maps together need."""
    grid = _grid(voxel, 1)
    views = [_posed(grid, maps, index, voxel, reach) for index in range(len(maps.names))]
    seen = [view[0].numpy() for view in views if view is not None]
    return len(np.unique(np.concatenate(seen), axis=0)) if seen else 1


def _grid(voxel: float, blocks: int) -> Any:
    import open3d as o3d

    core: Any = o3d.core  # its stubs know no NumPy array
    names, channels = ("tsdf", "weight", "color"), tuple(map(core.SizeVector, ([1], [1], [3])))
    types = (core.float32,) * 3
    return o3d.t.geometry.VoxelBlockGrid(names, types, channels, voxel, BLOCK, blocks, core.Device("CPU:0"))


def _posed(grid: Any, maps: DepthMaps, index: int, voxel: float, reach: float) -> tuple[Any, ...] | None:
    """Blocks, depth image, camera matrix, camera from world and largest depth of a view; None if nothing is seen."""
    import open3d as o3d

    core: Any = o3d.core
    camera = maps.intrinsics[index]
    values = np.ascontiguousarray(maps.depth[index, : camera.height, : camera.width])
    values = np.where(values < _farthest(camera, voxel), values, 0)
    if not values[::SEEN_STRIDE, ::SEEN_STRIDE].any():
        return None
    depth, limit = o3d.t.geometry.Image(core.Tensor(values)), float(values.max()) + voxel
    matrix, inverse = core.Tensor(camera.matrix), core.Tensor(np.linalg.inv(maps.world_from_cam[index]))
    blocks = grid.compute_unique_block_coordinates(depth, matrix, inverse, DEPTH_SCALE, limit, reach)
    return blocks, depth, matrix, inverse, limit


def _level_set(
    maps: DepthMaps, color_of: Callable[[int], ByteArray], voxel: float, blocks: int, config: FuseConfig, job: Job
) -> TriangleMesh:
    """Integrate all maps (Curless and Levoy 1996) and extract the zero level set."""
    import cv2
    import open3d as o3d

    core: Any = o3d.core
    reach, grid = config.truncation_voxels, _grid(voxel, blocks)
    fused = 0
    for index, camera in enumerate(maps.intrinsics):
        view = _posed(grid, maps, index, voxel, reach)
        if view is None:
            job.note(f"{maps.names[index]}: {np.count_nonzero(maps.depth[index])} readings are too few to fuse")
        else:
            fused += 1
            seen, depth, matrix, inverse, limit = view
            size = (camera.width, camera.height)
            picture = cv2.resize(color_of(index), size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
            color = o3d.t.geometry.Image(core.Tensor(picture))
            grid.integrate(seen, depth, color, matrix, inverse, DEPTH_SCALE, limit, reach)
        job.progress(0.8 * (index + 1) / len(maps.names), f"fusing view {index + 1} of {len(maps.names)}")
    surface = None
    if fused >= config.min_views:
        surface = grid.extract_triangle_mesh(config.min_views - 0.5)  # Open3D keeps what weighs more; a view weighs 1
    if surface is None or "indices" not in surface.triangle or len(surface.triangle.indices) == 0:
        hint = "are the poses right? lower min_views, or take more overlapping views"
        raise ScanError(f"no surface was seen by {config.min_views} of {len(maps.names)} views", hint=hint)
    colors = np.clip(np.round(255 * surface.vertex.colors.numpy()), 0, 255).astype(np.uint8)
    return canonical_mesh(surface.vertex.positions.numpy().astype(float), surface.triangle.indices.numpy(), colors)
