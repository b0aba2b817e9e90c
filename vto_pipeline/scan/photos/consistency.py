"""Keep only the depths that several photos agree on."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps


@njit(cache=True, nogil=True)
def consensus(depths, weights, tolerance, needed):  # type: ignore[no-untyped-def]  # typed by Numba
    """Merge what one photo's neighbours say about its depth.

    Each candidate is judged by the weight of those that agree with it; the best one's supporters are averaged.

    Args:
        depths: One map per neighbour [m], shape (K, H, W); 0 where unknown.
        weights: Inverse variance of each neighbour, up to a common factor, shape (K,).
        tolerance: Largest relative difference of depths that agree.
        needed: Neighbours that must agree, the candidate counted.

    Returns:
        Shape (H, W), float32; 0 where too few agree.
    """
    count, height, width = depths.shape
    merged = np.zeros((height, width), dtype=np.float32)
    for row in range(height):
        for column in range(width):
            best = 0.0
            for k in range(count):
                candidate = depths[k, row, column]
                if candidate == 0:
                    continue
                votes, total, mean = 0, 0.0, 0.0
                for m in range(count):
                    other = depths[m, row, column]
                    if other > 0 and abs(other - candidate) <= tolerance * candidate:
                        votes += 1
                        total += weights[m]
                        mean += weights[m] * other
                if votes >= needed and total > best:
                    best = total
                    merged[row, column] = mean / total
    return merged


def rays(camera_matrix: FloatArray, height: int, width: int) -> FloatArray:
    """Directions of all pixels with z = 1, shape (H, W, 3)."""
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    x, y = (u - camera_matrix[0, 2]) / camera_matrix[0, 0], (v - camera_matrix[1, 2]) / camera_matrix[1, 1]
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def agreeing_views(maps: DepthMaps, index: int, others: list[int], tolerance: float) -> NDArray[np.int32]:
    """Count the other maps that measured the same surface points as one map.

    Args:
        maps: Depth maps.
        index: The map in question.
        others: Those to ask.
        tolerance: Largest relative difference of depths that agree.

    Returns:
        Shape (H, W).
    """
    depth, pose = maps.depth[index], maps.world_from_cam[index]
    points = (rays(maps.intrinsics[index].matrix, *depth.shape) * depth[..., None]) @ pose[:3, :3].T + pose[:3, 3]
    votes = _count(points.reshape(-1, 3), *_stacked(maps, others), 0.0, tolerance).reshape(depth.shape)
    return np.asarray(np.where(depth > 0, votes, 0))


def moving(maps: DepthMaps, index: int, others: list[int], least_px: float) -> NDArray[np.bool_]:
    """Return which pixels of a map show places that another photo shows elsewhere in the picture, shape (H, W).

    Before a camera that stands still, what turns moves between photos. A background stays, and is matched with itself:
    as if it lay on the axis of the turn, where all rays through one pixel cross.

    Args:
        maps: Depth maps.
        index: The map in question.
        others: Photos to compare it with.
        least_px: What moves by no more in any of them, stays [px].
    """
    depth, pose = maps.depth[index], maps.world_from_cam[index]
    row, column = np.nonzero(depth)
    away = depth[row, column].astype(float)
    local = rays(maps.intrinsics[index].matrix, *depth.shape)[row, column] * away[:, None]
    points, here = local @ pose[:3, :3].T + pose[:3, 3], np.column_stack([column, row])
    moves = np.zeros(len(points), dtype=bool)
    for other in others:
        camera, its = maps.intrinsics[other], maps.world_from_cam[other]
        there = (points - its[:3, 3]) @ its[:3, :3]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = there[:, :2] / there[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
        moves |= ~(np.linalg.norm(pixels - here, axis=1) <= least_px)
    shown = np.zeros(depth.shape, dtype=bool)
    shown[row, column] = moves
    return shown


def views_on_surface(
    points: FloatArray, depth: NDArray[np.float32], camera: Intrinsics, world_from_cam: FloatArray, distance: float
) -> NDArray[np.int32]:
    """1 for each point (P, 3) that a depth map (H, W) lies within a distance [m] of, along the line of sight, or 0."""
    inverse = np.linalg.inv(world_from_cam)[None]
    return np.asarray(_count(points, depth[None], camera.matrix[None], inverse, distance, 0.0))


def _stacked(maps: DepthMaps, chosen: list[int]) -> tuple[NDArray[np.float32], FloatArray, FloatArray]:
    matrices: FloatArray = np.stack([maps.intrinsics[k].matrix for k in chosen])
    return maps.depth[chosen], matrices, np.asarray(np.linalg.inv(maps.world_from_cam[chosen]), dtype=np.float64)


@njit(cache=True, nogil=True)
def _count(points, depth, matrices, cam_from_world, distance, share):  # type: ignore[no-untyped-def]  # typed by Numba
    """Maps (M, H, W) whose depth at a point (P, 3) differs from its own by no more than distance + share · depth."""
    count, height, width = depth.shape
    votes = np.zeros(len(points), dtype=np.int32)
    for m in range(count):
        turn, shift = cam_from_world[m, :3, :3], cam_from_world[m, :3, 3]
        for n in range(len(points)):
            x, y, z = points[n]
            w = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + shift[2]
            if w <= 0:
                continue
            u = (turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + shift[0]) / w
            v = (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + shift[1]) / w
            column = int(np.round(matrices[m, 0, 0] * u + matrices[m, 0, 2]))
            row = int(np.round(matrices[m, 1, 1] * v + matrices[m, 1, 2]))
            if 0 <= column < width and 0 <= row < height and abs(depth[m, row, column] - w) <= distance + share * w:
                votes[n] += 1
    return votes
