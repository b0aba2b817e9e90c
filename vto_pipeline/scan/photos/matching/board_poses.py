"""Where photos were taken from, by the board's corners that they show: camera by camera, with its focal length."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.frames import CharucoBoard
from vto_pipeline.scan.photos.board import board_corners
from vto_pipeline.scan.photos.matching.nearest import Lines

LEAST_CORNERS = 6
"""Corners that a photo must show to be placed by them; four fix it, and two more tell whether they are right."""
SPREAD = 0.4
"""They spread so far across the direction in which they spread most, in squares: those of one row fix nothing."""
WRONG_PX = 3.0
"""A corner further from where the board would be shown is none of its [px]."""

Sightings = Mapping[str, tuple[IntArray, FloatArray]]
"""Photo -> ids (K,) and pixels (K, 2) of the corners that it shows, as `detect_board` finds them."""


class Placed(NamedTuple):
    """Where a photo was taken from, by the board.

    Args:
        rotation, shift: Camera from board's world, shape (3, 3) and (3,) [m].
        corners: Which of its corners agree, shape (K,).
    """

    rotation: FloatArray
    shift: FloatArray
    corners: NDArray[np.bool_]


def place_photos(camera: Any, board: CharucoBoard, found: Sightings) -> dict[str, Placed]:
    """Place photos of one camera by the board's corners, and find its focal length (Zhang 2000).

    Args:
        camera: A pycolmap Camera, whose focal length is changed to the one found.
        board: As it was printed.
        found: What each photo shows of it.

    Returns:
        Those that show enough corners that agree with it.
    """
    import cv2

    world = board_corners(board)
    good = {name: np.ones(len(ids), dtype=bool) for name, (ids, _) in found.items()}
    focal, cx, cy, k1 = camera.params
    placed: dict[str, Placed] = {}
    for _ in range(2):  # once more without the corners that do not agree
        names = [n for n, (ids, _) in found.items() if _fixes(world[ids[good[n]]], board.square_m)]
        if not names:
            return {}
        flat = [_flat(world[found[n][0][good[n]]]) for n in names]
        seen = [found[n][1][good[n]].astype(np.float32) for n in names]
        start = np.array([[focal, 0.0, cx - 0.5], [0.0, focal, cy - 0.5], [0.0, 0.0, 1.0]])
        fixed = cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
        fixed |= cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
        size, bent = (camera.width, camera.height), np.array([k1, 0.0, 0.0, 0.0, 0.0])
        threads = cv2.getNumThreads()
        cv2.setNumThreads(1)  # two sum in whatever order they come (OpenCV 5.0): other bits in a quarter of the runs
        try:
            _, lens, bent, turns, shifts = cv2.calibrateCamera(flat, seen, size, start, bent, flags=fixed)  # type: ignore[call-overload]
        except cv2.error:  # it may say that corners are all but on a line
            return {}
        finally:
            cv2.setNumThreads(threads)
        placed = {}
        for name, turn, shift in zip(names, turns, shifts, strict=True):
            ids, pixels = found[name]
            shown = cv2.projectPoints(_flat(world[ids]), turn, shift, lens, bent)[0].reshape(-1, 2)
            good[name] = np.linalg.norm(shown - pixels, axis=1) < WRONG_PX
            rotation = cv2.Rodrigues(turn)[0] @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
            if good[name].mean() > 0.5 and _fixes(world[ids[good[name]]], board.square_m):
                placed[name] = Placed(rotation, np.asarray(shift, dtype=np.float64).ravel(), good[name])
    if placed:
        camera.params = [lens[0, 0], cx, cy, k1]
        camera.has_prior_focal_length = True
    return placed


def beside_corners(camera: Any, pose: Placed, corners: FloatArray, margin: float, pixels: FloatArray) -> IntArray:
    """Return which pixels (K, 2), COLMAP's way, a photo does not show among the board's corners, shape (M,).

    Features of squares and markers are alike, and known several times worse than the corners.

    Args:
        camera: A pycolmap Camera.
        pose: Where the photo was taken.
        corners: That it shows, in the board's world [m], shape (N, 3).
        margin: About the rectangle of these [m].
        pixels: Of features.
    """
    if len(pixels) == 0:
        return np.empty(0, np.int32)
    way = np.column_stack([camera.cam_from_img(pixels), np.ones(len(pixels))]) @ pose.rotation
    center = -pose.rotation.T @ pose.shift
    down = way[:, 1] * np.sign(-center[1])
    reach = np.abs(center[1]) / np.where(down > 0, down, np.inf)  # to the plane that the board lies in
    there = center + reach[:, None] * way
    low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    inside = (down > 0) & ((there > low) & (there < high)).all(axis=1)
    return np.flatnonzero(~inside).astype(np.int32)


def epipolar_lines(
    one: Any, other: Any, first: Placed, second: Placed, here: FloatArray, there: FloatArray, most_px: float
) -> Lines:
    """Return where each of two photos sees what features of the other may be.

    Args:
        one, other: pycolmap Cameras.
        first, second: Where the two photos were taken.
        here, there: Pixels of their features, COLMAP's way, shape (N, 2) and (M, 2).
        most_px: Sampson's distance (1982) that a match may have [px].
    """
    turn = second.rotation @ first.rotation.T
    x, y, z = second.shift - turn @ first.shift
    essential = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ turn
    ray, ray_back = (
        np.column_stack([camera.cam_from_img(pixels), np.ones(len(pixels))]) if len(pixels) else np.empty((0, 3))
        for camera, pixels in ((other, there), (one, here))
    )
    most = most_px / np.sqrt(one.focal_length * other.focal_length)
    return Lines(ray_back @ essential.T, ray @ essential, ray, float(most))


def _flat(points: FloatArray) -> NDArray[np.float32]:
    """Return points of the board's world (K, 3) as OpenCV has a board: x and y in its plane, z away from the viewer."""
    return np.column_stack([points[:, 0], points[:, 2], -points[:, 1]]).astype(np.float32)


def _fixes(corners: FloatArray, square: float) -> bool:
    """Return whether corners (K, 3) [m] are enough to place a photo."""
    if len(corners) < LEAST_CORNERS:
        return False
    across = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[1]
    return bool(across > SPREAD * square * np.sqrt(len(corners)))
