"""What each photo shows of a surface: depth buffers, and how far a pixel is from where one thing hides another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.geometry.seen.depth_picture import depth_picture
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

STEP_PX = 6.0
"""Neighbouring pixels whose depths differ by more than this many pixels' width on the surface show two things: a
surface at 80 degrees to the photo differs by less."""

SLACK_PX = 1.5
"""Depths of one thing differ by so much between a pixel's centre and the rest of it, in widths on the surface."""


class Samples(NamedTuple):
    """Points on a mesh, N of them.

    Args:
        face: The triangle of each, shape (N,).
        weight: Barycentric coordinates there, shape (N, 3).
    """

    face: IntArray
    weight: NDArray[np.float32]


class View(NamedTuple):
    """A photo's look at the surface, without distortion.

    Args:
        camera: Without distortion.
        cam_from_world: Rigid transform [m], shape (4, 4).
        depth: Of the surface where nothing hides it [m], shape (H, W); infinite elsewhere.
        inside: Distance of each pixel from the next that shows something else [px], shape (H, W).
    """

    camera: Intrinsics
    cam_from_world: FloatArray
    depth: NDArray[np.float32]
    inside: NDArray[np.float32]


def look(
    mesh: TriangleMesh, occluder: TriangleMesh | None, camera: Intrinsics, world_from_cam: FloatArray, slack: float
) -> View:
    """Return what a photo shows of a mesh.

    Args:
        mesh: The surface [m].
        occluder: Whatever else may hide it [m], or None. It may hold the surface itself, measured a second time.
        camera: Lens.
        world_from_cam: Pose, shape (4, 4).
        slack: How far in front of the surface the occluder may be and hide nothing [m].
    """
    import cv2

    pinhole = camera.without_distortion()
    cam_from_world: FloatArray = np.asarray(np.linalg.inv(world_from_cam), dtype=np.float64)
    depth = depth_picture(mesh, pinhole, cam_from_world)
    if occluder is not None:
        depth[depth_picture(occluder, pinhole, cam_from_world) < depth - slack] = np.inf
    whole = np.isfinite(depth)
    width = STEP_PX * np.where(whole, depth, 0.0) / min(pinhole.fx, pinhole.fy)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):  # infinity less infinity
            step = np.abs(np.diff(depth, axis=axis))
        near, far = (slice(None, -1), slice(1, None)) if axis == 0 else (np.s_[:, :-1], np.s_[:, 1:])
        jump = step > np.minimum(width[near], width[far])
        whole[near] &= ~jump
        whole[far] &= ~jump
    inside = cv2.distanceTransform(whole.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return View(pinhole, cam_from_world, depth.astype(np.float32), np.asarray(inside, dtype=np.float32))


@njit(cache=True, parallel=True)
def rank_view(  # type: ignore[no-untyped-def]  # typed by Numba
    number,
    vertices,
    normals,
    faces,
    face,
    weight,
    lens,
    cam_from_world,
    depth,
    inside,
    least_cosine,
    border,
    best,
    score,
):
    """Note for each sample how well a photo shows it, among the best photos so far.

    The score is the area that a square metre of the surface has in the photo [px²], falling to nothing at grazing
    angles and near borders.

    Args:
        number: Of the photo.
        vertices, normals, faces: The surface; normals point to the side that is textured.
        face, weight: The samples.
        lens: fx, fy, cx, cy [px].
        cam_from_world: Pose, shape (4, 4).
        depth, inside: As in `View`.
        least_cosine: Of the angle between normal and line of sight.
        border: Pixels nearer to a border are not used [px].
        best: Photos of each sample, the best first, -1 where there is none, shape (N, K); changed.
        score: Their scores, shape (N, K); changed.
    """
    height, width = depth.shape
    fx, fy, cx, cy = lens
    slots = best.shape[1]
    m = cam_from_world
    center = np.zeros(3)
    for i in range(3):
        for j in range(3):
            center[i] -= m[j, i] * m[j, 3]
    for n in prange(len(face)):
        px, py, pz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(3):
            v, w = faces[face[n], k], weight[n, k]
            px += w * vertices[v, 0]
            py += w * vertices[v, 1]
            pz += w * vertices[v, 2]
            nx += w * normals[v, 0]
            ny += w * normals[v, 1]
            nz += w * normals[v, 2]
        sx, sy, sz = center[0] - px, center[1] - py, center[2] - pz
        away = np.sqrt(sx * sx + sy * sy + sz * sz)
        cosine = (nx * sx + ny * sy + nz * sz) / (max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12) * away)
        if cosine <= least_cosine:
            continue
        z = m[2, 0] * px + m[2, 1] * py + m[2, 2] * pz + m[2, 3]
        if z <= 0.0:
            continue
        u = fx * (m[0, 0] * px + m[0, 1] * py + m[0, 2] * pz + m[0, 3]) / z + cx
        v_px = fy * (m[1, 0] * px + m[1, 1] * py + m[1, 2] * pz + m[1, 3]) / z + cy
        column, row = int(np.floor(u + 0.5)), int(np.floor(v_px + 0.5))
        if column < 1 or row < 1 or column >= width - 1 or row >= height - 1 or inside[row, column] <= border:
            continue
        slope = np.sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine
        if z > depth[row, column] + SLACK_PX * (1.0 + slope) * z / min(fx, fy):
            continue
        clear = min((inside[row, column] - border) / (2.0 * border + 1.0), 1.0)
        facing = min((cosine - least_cosine) / 0.2, 1.0)
        value = fx * fy * cosine / (z * z) * clear * facing
        slot = slots
        while slot > 0 and value > score[n, slot - 1]:
            slot -= 1
        if slot == slots:
            continue
        for k in range(slots - 1, slot, -1):
            best[n, k], score[n, k] = best[n, k - 1], score[n, k - 1]
        best[n, slot], score[n, slot] = number, value


def lens_of(camera: Intrinsics) -> FloatArray:
    """fx, fy, cx, cy [px], as the kernels take them."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


def pixel_size(mesh: TriangleMesh, cameras: CameraSet) -> float:
    """Width of a pixel on the surface, at the median distance of the nearest photo [m]; infinite if all look away."""
    found = np.inf
    for camera, pose in zip(cameras.intrinsics, cameras.world_from_cam, strict=True):
        depth = (mesh.vertices - pose[:3, 3]) @ pose[:3, 2]
        if (depth > 0).any():
            found = min(found, float(np.median(depth[depth > 0])) / float(np.sqrt(camera.fx * camera.fy)))
    return found


def no_photo(count: int, slots: int) -> tuple[NDArray[np.int16], NDArray[np.float32]]:
    """Return the `best` and `score` of samples that no photo was ranked for."""
    return np.full((count, slots), -1, np.int16), np.zeros((count, slots), np.float32)
