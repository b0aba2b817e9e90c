"""Photos as stereo sees them: small enough, in one grey, with how brightly each was exposed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan.exposure import exposures
from vto_pipeline.scan.grey import best_shares, in_grey
from vto_pipeline.scan.photos.neighbours import camera_points
from vto_pipeline.scan.photos.rectify import StereoView

COLORED = 12
"""So many photos tell in which grey the print shows best."""


def stereo_views(
    photos: PhotoSet, cameras: CameraSet, cloud: PointCloud, seen: NDArray[np.bool_], max_side: int, job: Job
) -> list[StereoView]:
    """Read the photos that have a camera.

    Args:
        photos: Their files.
        cameras: Poses of those that were registered.
        cloud: Sparse points in the same frame.
        seen: Which of them each photo may see, shape (C, N).
        max_side: Photos are scaled down to this longer side [px].
        job: Receives the spread of exposures, and the grey where it is not the usual one.

    Raises:
        InputError: a camera names a photo that is not there.
    """
    paths = {path.name: path for path in photos.paths}
    for name in cameras.names:
        if name not in paths:
            raise InputError(f"there is a camera but no photo for {name}", where=str(photos.paths[0].parent))
    ours = [paths[name] for name in cameras.names]
    shares = _shares(ours, cameras, cloud, seen, max_side, job)
    views = []
    for path, camera, pose in zip(ours, cameras.intrinsics, cameras.world_from_cam, strict=True):
        gray, lens = _scaled_down(in_grey(read_image(path), shares), camera, max_side)
        views.append(StereoView(gray, lens, pose))
    pixels = np.zeros((*seen.shape, 2))
    for index, view in enumerate(views):
        pixels[index, seen[index]] = _pixels(cloud.points[seen[index]], view.camera, view.world_from_cam)
    found = exposures([view.gray for view in views], pixels, seen)
    job.measure(exposure_spread=round(float(found.max() / found.min()), 3))
    return [replace(view, exposure=float(exposure)) for view, exposure in zip(views, found, strict=True)]


def _shares(
    paths: list[Path], cameras: CameraSet, cloud: PointCloud, seen: NDArray[np.bool_], max_side: int, job: Job
) -> FloatArray:
    """Shares of red, green and blue in the grey that is matched, told by some photos round the sparse points."""

    def shown(index: int) -> tuple[ByteArray, FloatArray]:
        picture, lens = _scaled_down(read_image(paths[index]), cameras.intrinsics[index], max_side)
        return picture, _pixels(cloud.points[seen[index]], lens, cameras.world_from_cam[index])

    some = np.unique(np.linspace(0, len(paths) - 1, min(len(paths), COLORED)).round().astype(int))
    shares, gain = best_shares(shown(k) for k in some)
    if gain > 1.0:
        red, green, blue = 100.0 * shares
        what = f"{red:.0f} % red, {green:.0f} % green, {blue:.0f} % blue"
        job.note(f"matched in {what}: the print shows {gain:.1f} times as much as in the usual grey")
        job.measure(grey_shares=[round(float(share), 2) for share in shares], grey_gain=round(gain, 2))
    return shares


def _scaled_down(picture: ByteArray, camera: Intrinsics, max_side: int) -> tuple[ByteArray, Intrinsics]:
    """A picture with its longer side at most so long [px], and its camera."""
    import cv2

    scale = min(1.0, max_side / max(picture.shape[:2]))
    if scale == 1.0:
        return picture, camera
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    smaller: Any = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return smaller, camera.resized(*size)


def _pixels(points: FloatArray, lens: Intrinsics, world_from_cam: FloatArray) -> FloatArray:
    """Where a photo shows points that lie before it (N, 3), distortion included [px], shape (N, 2)."""
    x, y, z = camera_points(points, world_from_cam).T
    bend = 1.0 + lens.k1 * (x**2 + y**2) / z**2
    return np.column_stack([lens.fx * x / z * bend + lens.cx, lens.fy * y / z * bend + lens.cy])
