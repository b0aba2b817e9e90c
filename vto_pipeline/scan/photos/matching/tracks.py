"""Many more points in common to neighbouring photos than features give, and each to a tenth of a pixel.

A photo's sparse points give a rough depth in between. By it a neighbour is warped into the photo, where optical flow
then has only a few pixels to go: Lucas and Kanade 1981, in pyramids (Bouguet 2001). What flows back to where it came
from is a sighting.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics

CORNERS, APART_PX, STRENGTH = 600, 6, 0.01
"""Corners that are followed in each photo at most, how far apart, and their least strength [share of the best]."""
NEAR_PX = 60
"""So near to a sparse point, depth is known well enough to warp by [px of 1000]."""
CELL = 4
"""Depth is interpolated for blocks of so many pixels."""
BLUR, CONTRAST = 8.0, 40.0
"""Light is taken out: grey levels less their mean over so many pixels, and their spread made so many levels."""
FAINTEST = 2.0
"""A smaller spread is noise [grey levels]."""
WINDOW, LEVELS = 15, 2
"""Of the flow [px], and pyramid levels above the picture."""
ROUND_TRIP_PX, UNLIKE = 0.3, 30.0
"""Largest distance between where a corner was and where it flows back to, and mean difference of the windows."""


@dataclass(frozen=True)
class TrackedPhoto:
    """A photo that was placed.

    Args:
        gray: Shape (H, W), uint8, light taken out.
        camera: Of this picture, distortion included.
        cam_from_world: Shape (4, 4).
        pixels: Where it shows its sparse points, shape (K, 2).
        points: The sparse points, shape (K, 3).
    """

    gray: NDArray[np.uint8]
    camera: Intrinsics
    cam_from_world: FloatArray
    pixels: FloatArray
    points: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Return where the photo shows points (N, 3) [px], shape (N, 2); NaN behind it."""
        local = points @ self.cam_from_world[:3, :3].T + self.cam_from_world[:3, 3]
        depth = np.where(local[:, 2] > 0, local[:, 2], np.nan)
        flat = local[:, :2] / depth[:, None]
        bent = flat * (1.0 + self.camera.k1 * (flat**2).sum(axis=1, keepdims=True))
        return np.asarray(bent * [self.camera.fx, self.camera.fy] + [self.camera.cx, self.camera.cy])

    def unproject(self, pixels: FloatArray, depth: FloatArray) -> FloatArray:
        """Return the points (N, 3) at depths (N,) that pixels (N, 2) show."""
        local = depth[:, None] * np.column_stack([self._flat(pixels), np.ones(len(pixels))])
        return np.asarray((local - self.cam_from_world[:3, 3]) @ self.cam_from_world[:3, :3])

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Return the unit directions of pixels (N, 2) in the world, shape (N, 3)."""
        ray = np.column_stack([self._flat(pixels), np.ones(len(pixels))])
        return np.asarray(ray / np.linalg.norm(ray, axis=1, keepdims=True) @ self.cam_from_world[:3, :3])

    @property
    def center(self) -> FloatArray:
        """Where it was taken from, shape (3,)."""
        return np.asarray(-self.cam_from_world[:3, :3].T @ self.cam_from_world[:3, 3])

    def _flat(self, pixels: FloatArray) -> FloatArray:
        bent = (pixels - [self.camera.cx, self.camera.cy]) / [self.camera.fx, self.camera.fy]
        flat = bent
        for _ in range(8):
            flat = bent / (1.0 + self.camera.k1 * (flat**2).sum(axis=1, keepdims=True))
        return np.asarray(flat)


def without_light(gray: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a grey picture whose exposure and shading are taken out: what is left is the print."""
    import cv2

    level = gray.astype(np.float32)
    level -= cv2.GaussianBlur(level, (0, 0), BLUR)
    spread = np.sqrt(cv2.GaussianBlur(level * level, (0, 0), BLUR))
    return np.asarray(np.clip(128.0 + CONTRAST * level / np.maximum(spread, FAINTEST), 0, 255).astype(np.uint8))


def follow(photo: TrackedPhoto, others: list[TrackedPhoto]) -> tuple[FloatArray, FloatArray]:
    """Return corners of a photo (N, 2) [px], and where the others show them, (M, N, 2), NaN where they do not.

    Args:
        photo: With a few sparse points at least.
        others: Neighbours, M of them.
    """
    import cv2

    depth = _depth(photo)
    known = np.isfinite(depth)
    height, width = photo.gray.shape
    mask = cv2.resize(known.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    found: Any = cv2.goodFeaturesToTrack(photo.gray, CORNERS, STRENGTH, APART_PX, mask=mask)
    if found is None:
        return np.empty((0, 2)), np.empty((len(others), 0, 2))
    corners = np.asarray(found, np.float32).reshape(-1, 1, 2)
    v, u = np.nonzero(known)
    middle = CELL * (np.column_stack([u, v]).astype(np.float64) + 0.5) - 0.5
    shown = photo.unproject(middle, depth[known])
    seen = np.full((len(others), len(corners), 2), np.nan)
    for index, other in enumerate(others):
        place = np.full((*depth.shape, 2), -1.0, np.float32)
        place[known] = np.nan_to_num(other.project(shown), nan=-1.0)
        place = cv2.resize(place, (width, height), interpolation=cv2.INTER_LINEAR)
        warped: Any = cv2.remap(other.gray, place[..., 0], place[..., 1], cv2.INTER_CUBIC)
        there, back, good = _flow(photo.gray, warped, corners)
        there, good = there.reshape(-1, 2), good & (np.linalg.norm(back - corners, axis=2).ravel() < ROUND_TRIP_PX)
        good &= (there > 0).all(axis=1) & (there < [width - 1, height - 1]).all(axis=1)
        good[good] &= mask[tuple(there[good].round().astype(int).T[::-1])] > 0
        at = cv2.remap(place, there[None, :, 0], there[None, :, 1], cv2.INTER_LINEAR)[0]
        seen[index, good] = at[good]
    return corners.reshape(-1, 2).astype(float), seen


def _flow(
    first: NDArray[np.uint8], second: NDArray[np.uint8], corners: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """Return where corners flow, where these flow back to, and which windows look alike."""
    import cv2

    settings: dict[str, Any] = {"winSize": (WINDOW, WINDOW), "maxLevel": LEVELS}
    there: Any
    back: Any
    there, one, unlike = cv2.calcOpticalFlowPyrLK(first, second, corners, np.empty(0, np.float32), **settings)
    back, other, _ = cv2.calcOpticalFlowPyrLK(second, first, there, np.empty(0, np.float32), **settings)
    return there, back, (one.ravel() > 0) & (other.ravel() > 0) & (unlike.ravel() < UNLIKE)


def _depth(photo: TrackedPhoto) -> FloatArray:
    """Return the depth between a photo's sparse points for blocks of pixels; NaN far from any of them.

    Inverse depth is linear over each triangle of Delaunay's triangulation, as it is on a plane.
    """
    import cv2
    from scipy.spatial import Delaunay, QhullError

    height, width = photo.gray.shape
    shape = height // CELL, width // CELL
    place = (photo.pixels + 0.5) / CELL - 0.5
    inverse = 1.0 / (photo.points @ photo.cam_from_world[2, :3] + photo.cam_from_world[2, 3])
    try:
        triangles = Delaunay(place).simplices
    except (QhullError, ValueError):  # fewer than three points, or all on one line
        return np.full(shape, np.nan)
    which, dots = np.zeros(shape, np.int32), np.zeros(shape, np.uint8)
    for number, corners in enumerate(np.rint(place).astype(np.int32)[triangles]):
        cv2.fillConvexPoly(which, corners, number + 1)
    column, row = np.rint(place).astype(int).T
    dots[row.clip(0, shape[0] - 1), column.clip(0, shape[1] - 1)] = 1
    reach = max(1, round(NEAR_PX * max(height, width) / 1000 / CELL))
    near = cv2.dilate(dots, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1,) * 2)) > 0
    spot = np.concatenate([place[triangles], np.ones((*triangles.shape, 1))], axis=2)
    planes = np.linalg.pinv(spot) @ inverse[triangles][..., None]
    v, u = np.mgrid[: shape[0], : shape[1]]
    plane = planes[np.maximum(which - 1, 0), :, 0]
    found = plane[..., 0] * u + plane[..., 1] * v + plane[..., 2]
    inside = near & (which > 0) & (found > 0.5 * inverse.min()) & (found < 2.0 * inverse.max())
    return np.where(inside, 1.0 / np.where(inside, found, 1.0), np.nan)
