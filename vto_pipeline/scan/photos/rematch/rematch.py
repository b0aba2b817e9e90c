"""Look again, along a guessed surface, for what the depth maps lack."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.scan.depth_views import depth_only, pixel_on_surface, supporting_views
from vto_pipeline.scan.photos.rematch.guess import guess_surface
from vto_pipeline.scan.photos.rematch.look import (
    MOST_PATCHES,
    GreyPhotos,
    RematchConfig,
    grey_photos,
    look_along,
    projected,
)

SUPPORT_PX = 2.0
"""Depth maps within this distance show a place of the surface."""
FARTHEST_PX = 40.0
"""Nothing is guessed farther than this from all confirmed depth."""
LITTLE = 0.002
"""A look that adds a smaller share to the depth is the last."""


def rematch(grays: Iterable[NDArray[np.uint8]], maps: DepthMaps, config: RematchConfig, job: Job) -> DepthMaps:
    """Add depth that two photos alone did not give: patches of a guessed surface are matched in all that see them.

    Semi-global matching compares upright windows, and loses what neither photo of a pair sees squarely. A closed
    surface through the depth there is tells place and slant of the rest nearly enough. Its patches are moved along
    their normals to where the photos agree, and neighbours stay together. Each photo keeps the depth that it finds.

    Args:
        grays: The maps' photos, undistorted, each of its map's size.
        maps: Confirmed depths.
        config: Settings.
        job: Receives the share of pixels added, and progress.

    Returns:
        The maps with depth added where there was none.

    Raises:
        ScanError: no surface can be guessed.
    """
    pixel = pixel_on_surface(depth_only(maps))
    photos = grey_photos(grays, maps)
    before = int((maps.depth > 0).sum())
    known = before
    for number in range(config.rounds):
        maps = _round(photos, maps, pixel, config)
        last, known = known, int((maps.depth > 0).sum())
        job.progress(0.95 + 0.05 * (number + 1) / config.rounds, f"second look {number + 1} of {config.rounds} at most")
        if known - last < LITTLE * last:
            break
    job.measure(rematched_share=round(1.0 - before / known, 3))
    return maps


def _round(photos: GreyPhotos, maps: DepthMaps, pixel: float, config: RematchConfig) -> DepthMaps:
    """One look at all that lacks depth: where the last one found nothing, too, for the guess is a better one now."""
    mesh, points = guess_surface(maps, pixel)
    shown = supporting_views(depth_only(maps), mesh.vertices, SUPPORT_PX * pixel) >= 2
    distance, _ = cKDTree(points).query(mesh.vertices, distance_upper_bound=FARTHEST_PX * pixel)
    distance[shown] = np.inf
    nearest = np.argsort(distance, kind="stable")[: min(MOST_PATCHES, int(np.isfinite(distance).sum()))]
    lacking: IntArray = np.sort(nearest).astype(np.int32)
    if len(lacking) == 0:
        return maps
    look = look_along(mesh, lacking, shown, photos, pixel, config)
    # per photo, the way of each vertex along its normal; unknown where the photo does not see it or finds it elsewhere
    ways = np.full((len(maps.names), len(mesh.vertices)), np.nan)
    ways[:, shown] = 0.0
    sure, agreed = look.sure, look.agrees & look.sure[:, None]
    ways[look.views[sure, look.column[sure]], lacking[sure]] = look.moved[lacking[sure]]
    place, other = np.nonzero(agreed)
    ways[look.views[place, other], lacking[place]] = look.own[place, other]
    new = np.zeros(len(mesh.vertices), dtype=bool)
    new[lacking[sure]] = True
    return _filled(maps, look.last, look.normals, look.moved, ways, new)


def _filled(
    maps: DepthMaps,
    mesh: TriangleMesh,
    normals: FloatArray,
    moved: FloatArray,
    ways: FloatArray,
    new: NDArray[np.bool_],
) -> DepthMaps:
    """The maps, with the depth of faces whose corners each photo knows, where it had none."""
    depth = maps.depth.copy()
    fresh = new[mesh.faces].any(axis=1)

    def fill(k: int) -> None:
        lens, pose = maps.intrinsics[k], maps.world_from_cam[k]
        known = np.isfinite(ways[k])
        placed, ahead = projected(
            mesh.vertices + np.where(known, ways[k], moved)[:, None] * normals, lens, np.linalg.inv(pose)
        )
        whole = np.flatnonzero(ahead[mesh.faces].all(axis=1))
        face, _, away = rasterise(placed[mesh.faces[whole]], lens.width, lens.height)
        good = (fresh & known[mesh.faces].all(axis=1))[whole]
        own = depth[k, : lens.height, : lens.width]
        add = (face >= 0) & good[face] & (own == 0)
        own[add] = away[add]

    for _ in in_order(fill, len(maps.names)):
        pass
    depth.flags.writeable = False
    return replace(maps, depth=depth)
