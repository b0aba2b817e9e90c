"""Posed depth maps that are read when they are needed, so that any number of them fits in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.depth import frame_color, frame_depth
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthFrameSet, DepthMaps
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.depth.depth_mask import clean_depth
from vto_pipeline.scan.object_sphere import Sphere, inside_sphere
from vto_pipeline.scan.photos.consistency import views_on_surface

GREY = 200
"""Colour of a surface without photos."""

SAMPLED = 40
"""Maps looked at, evenly spread, to choose the size of voxels and to count them."""


@dataclass(frozen=True)
class DepthViews:
    """Posed depth maps.

    Args:
        names: File names, C of them.
        intrinsics: Of the maps, without distortion.
        world_from_cam: Rigid transforms [m], shape (C, 4, 4).
        depth_of: Reads a map [m], shape (H, W); 0 where there is no reading.
        color_of: Reads its colours, shape (H', W', 3).
    """

    names: tuple[str, ...]
    intrinsics: tuple[Intrinsics, ...]
    world_from_cam: FloatArray
    depth_of: Callable[[int], NDArray[np.float32]]
    color_of: Callable[[int], ByteArray]

    def depths(self, chosen: NDArray[np.int_] | None = None) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """Yield index and depth of each map, or of some, in order."""
        order = np.arange(len(self.names)) if chosen is None else chosen
        return in_order(lambda k: (int(order[k]), self.depth_of(int(order[k]))), len(order))

    def sample(self) -> NDArray[np.int_]:
        """Some maps, evenly spread."""
        count = len(self.names)
        return np.unique(np.linspace(0, count - 1, min(count, SAMPLED)).round().astype(int))


def depth_only(maps: DepthMaps) -> DepthViews:
    """Return the depth maps of photos as views without colours."""

    def depth_of(index: int) -> NDArray[np.float32]:
        lens = maps.intrinsics[index]
        return np.ascontiguousarray(maps.depth[index, : lens.height, : lens.width])

    return DepthViews(
        maps.names, maps.intrinsics, maps.world_from_cam, depth_of, lambda _: np.empty((0, 0, 3), np.uint8)
    )


def placed(world_from_cam: FloatArray) -> NDArray[np.int_]:
    """Return which frames have a pose, of transforms (N, 4, 4) that are NaN for those left out."""
    return np.flatnonzero(np.isfinite(world_from_cam).all(axis=(1, 2)))


def frame_views(frames: DepthFrameSet, world_from_cam: FloatArray, sphere: Sphere | None = None) -> DepthViews:
    """Return the frames of a depth camera as views, without their flying pixels.

    Args:
        frames: Depth, and colour if there is any.
        world_from_cam: Poses [m], shape (N, 4, 4); NaN for frames to leave out.
        sphere: What lies outside of it is left out, too.
    """
    used = placed(world_from_cam)
    camera, poses = frames.intrinsics, world_from_cam[used]
    plain = np.full((camera.height, camera.width, 3), GREY, np.uint8)

    def depth_of(index: int) -> NDArray[np.float32]:
        depth = clean_depth(frame_depth(frames, int(used[index])), camera)
        return depth if sphere is None else inside_sphere(depth, camera, poses[index], sphere)

    def color_of(index: int) -> ByteArray:
        picture = frame_color(frames, int(used[index]))
        return plain if picture is None else picture

    names = tuple(frames.depth_paths[k].name for k in used)
    return DepthViews(names, (camera,) * len(used), poses, depth_of, color_of)


def pixel_on_surface(views: DepthViews) -> float:
    """Side of a pixel on the surface [m], the median over a sample of the maps.

    Raises:
        ScanError: no map holds a reading.
    """
    sizes = [np.median(d[d > 0]) / views.intrinsics[k].fx for k, d in views.depths(views.sample()) if d.any()]
    if not sizes:
        sizes = [np.median(d[d > 0]) / views.intrinsics[k].fx for k, d in views.depths() if d.any()]
    if not sizes:
        raise ScanError(f"none of {len(views.names)} depth maps holds a reading", hint="is depth_scale right?")
    return float(np.median(sizes))


def supporting_views(views: DepthViews, points: FloatArray, distance: float) -> NDArray[np.int32]:
    """Count the maps that lie within a distance [m] of each point (P, 3), along the line of sight, shape (P,)."""
    votes = np.zeros(len(points), np.int32)
    for index, depth in views.depths():
        votes += views_on_surface(points, depth, views.intrinsics[index], views.world_from_cam[index], distance)
    return votes
