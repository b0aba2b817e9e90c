"""One surface from many depth maps: a truncated signed distance field on sparse voxels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.geometry.topology import component_areas
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthFrameSet, DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.scan.canonical import drop_small_pieces, drop_vertices
from vto_pipeline.scan.depth_views import (
    DepthViews,
    depth_only,
    frame_views,
    pixel_on_surface,
    placed,
    supporting_views,
)
from vto_pipeline.scan.level_set import count_blocks, level_set
from vto_pipeline.scan.library_message import library_message
from vto_pipeline.scan.object_sphere import object_sphere
from vto_pipeline.scan.photos.coverage import covered_share

MAX_BLOCKS = 10_000
"""0.8 GB of distances, weights and colours; a scene that needs more gets coarser voxels."""

BLOCK_BYTES = 250_000
"""What one takes in the end, with its part of the surface [B]; 146 to 220 thousand in scenes of 1,600 to 11,000."""

PIXEL_BYTES = 40
"""Of the depth map and picture of a view at work [B]."""


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

    return _fuse(replace(depth_only(maps), color_of=color_of), config, job)


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
        world_from_cam: Poses [m], shape (N, 4, 4); NaN for frames to leave out.
        config: Settings.
        job: Receives progress, frame by frame.

    Returns:
        Surface [m], open where nothing was seen.

    Raises:
        ScanError: no surface came out.
    """
    sphere = object_sphere(world_from_cam[placed(world_from_cam)])
    if sphere is None:
        job.note("the frames do not look at one place from around: all that they see is fused")
    else:
        job.note(f"fused what is within {sphere.radius:.2f} m of the place that the frames look at")
    return _fuse(frame_views(frames, world_from_cam, sphere), config, job)


def _fuse(views: DepthViews, config: FuseConfig, job: Job) -> TriangleMesh:
    """Extract the surface, and keep what the depth maps lie on.

    A sheet of cloth seen from both sides leaves false sheets a truncation away on either side, where one side's free
    space meets the other's unknown; no depth map lies on those.
    """
    voxel = config.voxel_mm / 1000 if config.voxel_mm else config.voxel_pixels * pixel_on_surface(views)
    wish = voxel
    while (blocks := count_blocks(views, voxel, config.truncation_voxels)) > MAX_BLOCKS:
        voxel *= max(1.05, np.sqrt(blocks / MAX_BLOCKS))  # a surface meets 1 / side² of them
    if voxel > wish:
        problem = f"voxels of {1000 * voxel:.3g} mm instead of {1000 * wish:.3g} mm, so that all fit in memory"
        job.warn(f"{problem}; leave out what is not the object")
    _check_memory(views, blocks, voxel, job)
    try:
        mesh = level_set(views, voxel, blocks, config.truncation_voxels, config.min_views, job)
    except RuntimeError as error:
        raise ScanError(f"the depth maps could not be fused: {library_message(error)}") from error
    support = supporting_views(views, mesh.vertices, config.support_voxels * voxel)
    mesh = drop_small_pieces(drop_vertices(mesh, support < config.min_views), config.min_piece, job)
    job.measure(voxel_mm=round(1000 * voxel, 3), points=len(mesh.vertices), triangles=len(mesh.faces))
    return mesh


def _check_memory(views: DepthViews, blocks: int, voxel: float, job: Job) -> None:
    """Refuse what does not fit. Coarser voxels would fit, but a result must not depend on the memory there was.

    Raises:
        ScanError: it does not fit; the voxel that would is named.
    """
    maps = PIXEL_BYTES * max(camera.width * camera.height for camera in views.intrinsics)
    needed, free = BLOCK_BYTES * blocks + maps, job.memory_left()
    job.measure(memory_bound_mb=round(needed / 1e6))
    if needed > free:
        has = "this machine has" if math.isinf(job.memory) else "the budget leaves"
        problem = f"voxels of {1000 * voxel:.3g} mm need up to {needed / 1e9:.2g} GB of memory"
        fitting = math.ceil(1e4 * voxel * math.sqrt(BLOCK_BYTES * blocks / (free - maps))) / 10 if free > maps else None
        coarser = "" if fitting is None else f", or set voxel_mm to about {fitting:g}"
        raise ScanError(f"{problem}; {has} {max(0.0, free) / 1e9:.2g} GB", hint=f"give more memory{coarser}")
