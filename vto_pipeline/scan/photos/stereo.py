"""Dense depth from posed photos: semi-global matching of neighbours, consensus, a check, and a second look."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.undistort import undistorted
from vto_pipeline.model.camera import CameraSet
from vto_pipeline.model.frames import DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.cpu_threads import in_order
from vto_pipeline.scan.library_message import library_message
from vto_pipeline.scan.photos.consistency import agreeing_views, consensus, moving, rays
from vto_pipeline.scan.photos.disparity import MatchConfig, match_pair
from vto_pipeline.scan.photos.matching.fixed_camera import MOVING_SHARE
from vto_pipeline.scan.photos.neighbours import choose_pairs, visibility
from vto_pipeline.scan.photos.rectify import StereoView, rectify
from vto_pipeline.scan.photos.region import object_region
from vto_pipeline.scan.photos.rematch.look import RematchConfig, look_bytes
from vto_pipeline.scan.photos.rematch.rematch import rematch
from vto_pipeline.scan.photos.views import stereo_views

PAIR_BYTES = 250
"""Working memory of one pair per pixel of a photo, with windows as large as they may be [B]."""


class StereoConfig(Config):
    """Settings of dense stereo."""

    max_side_px: int = Field(1000, ge=200, le=6000, description="Photos are scaled down to this longer side [px]")
    neighbours: int = Field(5, ge=1, le=12, description="Photos that each photo is matched with")
    min_shared_points: int = Field(12, ge=3, le=1000, description="Sparse points that two matched photos share")
    range_margin: float = Field(0.1, ge=0, le=1, description="Search beyond the sparse points [share of extent]")
    consensus_tolerance: float = Field(0.003, gt=0, le=0.1, description="Relative difference of depths that agree")
    consensus_needed: int = Field(2, ge=1, le=12, description="Neighbours of a photo that must agree on a depth")
    check_tolerance: float = Field(0.002, gt=0, le=0.1, description="The same between maps of different photos")
    check_views: int = Field(2, ge=0, le=12, description="Other photos that must have measured the same point")
    match: MatchConfig = Field(default_factory=MatchConfig, description="Settings of the matcher")
    rematch: RematchConfig = Field(default_factory=RematchConfig, description="Settings of the second look")


def estimate_depth_maps(
    photos: PhotoSet, cameras: CameraSet, cloud: PointCloud, config: StereoConfig, job: Job
) -> DepthMaps:
    """Measure the depth of each posed photo.

    Args:
        photos: The photos' files.
        cameras: Poses of those that were registered.
        cloud: Sparse points in the same frame; they choose the neighbours and the range of depths.
        config: Settings.
        job: Receives progress, pair by pair.

    Returns:
        Depth maps of all registered photos, most pixels of which are 0 = unknown outside the object.

    Raises:
        InputError: a camera names a photo that is not there.
        ScanError: no two photos share enough of the surface, the memory is too small, or no depth is agreed on.
    """
    seen = visibility(cameras, cloud)
    views = stereo_views(photos, cameras, cloud, seen, config.max_side_px, job)
    pairs = choose_pairs(cameras, cloud, seen, config.neighbours, config.min_shared_points)
    if not pairs:
        hint = "photos about 15 degrees apart work best; is there texture?"
        raise ScanError(f"no two of {len(views)} photos share {config.min_shared_points} sparse points", hint=hint)
    threads = _threads(views, pairs, config, job)
    pinholes = tuple(view.camera.without_distortion() for view in views)
    depth = _merge(cameras.names, views, pairs, cloud, seen, config, threads, job)
    merged = DepthMaps(cameras.names, pinholes, cameras.world_from_cam, depth)
    checked = _check(merged, pairs, config, job)
    measured, kept = int((merged.depth > 0).sum()), int((checked > 0).sum())
    if kept == 0:
        hint = "is the fabric plain? add a print, a speckle pattern or projected light, or use a depth camera"
        raise ScanError(f"no depth is confirmed by {config.check_views + 1} photos", hint=hint)
    blind = [name for name, depth in zip(cameras.names, checked, strict=True) if not depth.any()]
    if blind:
        job.warn(f"no depth in {len(blind)} of {len(views)} photos: {', '.join(blind)}")
    job.measure(pairs=len(pairs), depth_pixels=kept, consistent_share=round(kept / measured, 3))
    maps = replace(merged, depth=checked)
    del merged  # as large as what is kept
    if cameras.still:
        maps = _without_background(maps, pairs, job)
    if config.rematch.rounds == 0:
        return maps
    try:
        maps = rematch((undistorted(view.gray, view.camera) for view in views), maps, config.rematch, job)
    except ScanError as error:
        job.note(f"no second look: {error.problem}")
        return maps
    return _without_background(maps, pairs, job) if cameras.still else maps


def _threads(views: list[StereoView], pairs: list[tuple[int, int]], config: StereoConfig, job: Job) -> int:
    """Return how many pairs are matched at once: one a core, as memory allows. What it needs follows from the pairs.
    The second look comes after them, and may need more.

    Raises:
        ScanError: it does not even allow one.
    """
    pixels = max(view.gray.shape[0] for view in views) * max(view.gray.shape[1] for view in views)
    left = np.bincount(np.array(pairs).ravel(), minlength=len(views))
    waiting = most = 0
    found = np.zeros(len(views), dtype=int)
    for pair in pairs:  # in this order; a photo's maps are merged when its last pair is done
        for index in pair:
            found[index] += 1
            waiting += 1
            most = max(most, waiting)
            if found[index] == left[index]:
                waiting -= left[index]
    kept = (1 + 4 + 4) * len(views) + 4 * (most + left.max())  # grey, merged, checked; maps, and those being merged
    cores, free = os.cpu_count() or 1, job.memory_left()
    threads = min(cores, int((free / pixels - kept) / PAIR_BYTES))
    again = look_bytes(len(views), pixels) if config.rematch.rounds else 0.0
    needed = max(pixels * (kept + PAIR_BYTES * max(1, threads)), again)
    if threads < 1 or again > free:
        has = "this machine has" if math.isinf(job.memory) else "the budget leaves"
        problem = f"{len(views)} photos need up to {needed / 1e9:.1f} GB of memory; {has} {max(0.0, free) / 1e9:.1f} GB"
        raise ScanError(problem, hint="lower stereo.max_side_px, or give more memory")
    job.measure(memory_bound_mb=round(needed / 1e6))
    job.note(f"{len(pairs)} pairs in at most {needed / 1e9:.1f} GB of memory, {threads} at a time on {cores} cores")
    return threads


def _merge(
    names: tuple[str, ...],
    views: list[StereoView],
    pairs: list[tuple[int, int]],
    cloud: PointCloud,
    seen: NDArray[np.bool_],
    config: StereoConfig,
    threads: int,
    job: Job,
) -> NDArray[np.float32]:
    """Match all pairs and merge the findings of each photo's neighbours, shape (C, H, W)."""
    import cv2

    height, width = max(v.gray.shape[0] for v in views), max(v.gray.shape[1] for v in views)
    merged = np.zeros((len(views), height, width), dtype=np.float32)
    waiting = np.bincount(np.array(pairs).ravel(), minlength=len(views))
    found: list[list[tuple[float, NDArray[np.float32]]]] = [[] for _ in views]

    def work(pair: tuple[int, int]) -> tuple[float, NDArray[np.float32], NDArray[np.float32]] | str:
        first, second = views[pair[0]], views[pair[1]]
        try:
            frame = rectify(first, second, cloud.points[seen[pair[0]] & seen[pair[1]]], config.range_margin)
            return (frame.typical_disparity**2, *match_pair(first, second, frame, config.match))
        except (cv2.error, ScanError) as error:
            return library_message(error) if isinstance(error, cv2.error) else error.problem

    for done, (pair, matched) in enumerate(_in_order(work, pairs, threads)):
        if isinstance(matched, str):
            job.warn(f"left out the pair {names[pair[0]]} and {names[pair[1]]}: {matched}")
        for side, index in enumerate(pair):
            if not isinstance(matched, str):
                found[index].append((matched[0], matched[1 + side]))
            waiting[index] -= 1
            if waiting[index] == 0 and found[index]:
                depths, weights = np.stack([d for _, d in found[index]]), np.array([w for w, _ in found[index]])
                agreed = consensus(depths, weights, config.consensus_tolerance, config.consensus_needed)
                merged[index, : agreed.shape[0], : agreed.shape[1]] = agreed
                found[index] = []
        job.progress(0.9 * (done + 1) / len(pairs), f"pair {done + 1} of {len(pairs)}")
    merged.flags.writeable = False  # so that it is not copied
    return merged


def _in_order(
    work: Callable[[Any], Any], pairs: list[tuple[int, int]], threads: int
) -> Iterator[tuple[tuple[int, int], Any]]:
    """Run pairs side by side and give the results in the order of the pairs, so that sums are reproducible.

    No more than two pairs a thread are under way or waiting for their turn: that bounds the memory.
    """
    with ThreadPoolExecutor(threads) as pool:
        running: deque[tuple[tuple[int, int], Future[Any]]] = deque()
        for pair in pairs:
            running.append((pair, pool.submit(work, pair)))
            if len(running) == 2 * threads:
                pair, future = running.popleft()
                yield pair, future.result()
        while running:
            pair, future = running.popleft()
            yield pair, future.result()


def _without_background(maps: DepthMaps, pairs: list[tuple[int, int]], job: Job) -> DepthMaps:
    """Leave out depth of what stays in its place before a camera that does: the background, matched with itself."""
    depth = maps.depth.copy()
    least = MOVING_SHARE * max(max(lens.width, lens.height) for lens in maps.intrinsics)

    def drop(i: int) -> None:
        depth[i][~moving(maps, i, _paired(pairs, i), least)] = 0

    for _ in in_order(drop, len(depth)):
        pass
    left = int((depth > 0).sum())
    if left == 0:
        raise ScanError("all that has depth stays in its place, as a background does", hint="does the object turn?")
    before = int((maps.depth > 0).sum())
    job.note(f"left out {100 * (1 - left / before):.1f} % of the depth: it stays in its place, as the camera does")
    depth.flags.writeable = False
    return replace(maps, depth=depth)


def _paired(pairs: list[tuple[int, int]], index: int) -> list[int]:
    """Return the photos that one is paired with."""
    return sorted({a + b - index for a, b in pairs if index in (a, b)})


def _check(merged: DepthMaps, pairs: list[tuple[int, int]], config: StereoConfig, job: Job) -> NDArray[np.float32]:
    """Depths that enough other photos confirm and that can be of the object, shape (C, H, W)."""
    checked = np.zeros_like(merged.depth)
    region = object_region(CameraSet(merged.names, merged.intrinsics, merged.world_from_cam))

    def check(i: int) -> None:
        depth, others = merged.depth[i], _paired(pairs, i)
        if others:
            votes = agreeing_views(merged, i, others, config.check_tolerance)
            checked[i] = np.where(votes >= config.check_views, depth, 0)
            if region is not None:
                local = rays(merged.intrinsics[i].matrix, *depth.shape) * depth[..., None]
                pose = merged.world_from_cam[i]
                checked[i][~region.holds(local @ pose[:3, :3].T + pose[:3, 3])] = 0

    for i, _ in enumerate(in_order(check, len(checked))):
        job.progress(0.9 + 0.05 * (i + 1) / len(checked), f"checking photo {i + 1} of {len(checked)}")
    checked.flags.writeable = False
    return checked
