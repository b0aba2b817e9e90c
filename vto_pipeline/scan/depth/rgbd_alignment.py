"""Rigid alignment of two depth frames by shape and colour.

From the same start, Open3D's Hybrid odometry errs about twice as much (`tests/scan/test_rgbd_alignment.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.photos.consistency import rays

DEPTH_SIGMA, BRIGHTNESS_SIGMA = 0.0015, 0.03
"""Noise of a reading at 1 m, growing with its square [m]; noise of brightness, on a scale from 0 to 1."""

HUBER = 1.5
"""Residuals beyond this many sigmas count linearly."""

SMALL_STEP = 1e-5
"""A pass ends when the motion changes by less than this [rad, m]."""

STRIDES, STEPS = (4, 2, 1), (8, 8, 8)
"""Every n-th pixel of the source in each pass, and Gauss-Newton steps of the pass at most."""


@dataclass(frozen=True)
class RgbdFrame:
    """One frame, prepared for alignment.

    Args:
        points: In the camera's frame [m], shape (H, W, 3); z = 0 where there is no reading.
        normals: Unit, towards the camera, shape (H, W, 3); 0 where unknown.
        brightness: 0 to 1, slightly blurred, shape (H, W).
        slope: Change of the brightness per pixel along x and y, shape (H, W, 2).
    """

    points: FloatArray
    normals: FloatArray
    brightness: FloatArray
    slope: FloatArray


@dataclass(frozen=True)
class RgbdAlignment:
    """Result of `align_frames`.

    Args:
        target_from_source: Rigid transform, shape (4, 4).
        information: Inverse covariance of (rotation, translation) up to a common factor, shape (6, 6).
        overlap: Share of the source's readings that fell on the target's surface.
    """

    target_from_source: FloatArray
    information: FloatArray
    overlap: float


def prepare_frame(color: ByteArray | None, depth: NDArray[np.float32], camera: Intrinsics) -> RgbdFrame:
    """Compute points, normals and brightness of a frame; without colour, brightness is 0 everywhere."""
    import cv2

    height, width = depth.shape
    known = (depth > 0).astype(np.float32)
    weight = cv2.GaussianBlur(known, (0, 0), 1.5)
    smooth = cv2.GaussianBlur(depth, (0, 0), 1.5) / np.maximum(weight, 1e-6)  # readings are too noisy to differentiate
    direction = rays(camera.matrix, height, width)
    surface = direction * smooth[..., None]
    normals = np.cross(np.gradient(surface, axis=0), np.gradient(surface, axis=1))
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    whole = cv2.erode(known, np.ones((5, 5), np.uint8))[..., None] > 0
    normals = np.where(whole & (length > 0), -normals / np.maximum(length, 1e-300), 0.0)
    gray = np.zeros((height, width), np.uint8) if color is None else cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    brightness = np.asarray(cv2.GaussianBlur(gray.astype(np.float64) / 255, (0, 0), 1.0), dtype=np.float64)
    slope = np.stack([np.gradient(brightness, axis=1), np.gradient(brightness, axis=0)], axis=-1)
    return RgbdFrame(direction * depth[..., None].astype(float), normals, brightness, slope)


def align_frames(
    source: RgbdFrame, target: RgbdFrame, camera: Intrinsics, start: FloatArray, max_jump: float
) -> RgbdAlignment:
    """Align by point-to-plane distance and brightness together, Gauss-Newton with Huber weights.

    Park et al. 2017 (joint photometric and geometric objective), with projective association (Newcombe et al. 2011).

    Args:
        source, target: Frames of one camera.
        camera: It.
        start: First guess of target_from_source, shape (4, 4).
        max_jump: Readings further than this from the target's surface do not count [m].

    Raises:
        ScanError: too little overlap to fix the motion.
    """
    transform = np.array(start, dtype=float)
    for stride, steps in zip(STRIDES, STEPS, strict=True):
        points, brightness, total = _readings(source, stride)
        for _ in range(steps):
            system, side, count, _ = _sums(points, brightness, target, camera, transform, max_jump)
            if count < 100 or not np.linalg.cond(system) < 1e12:
                raise ScanError(f"lost track: {int(count)} of {total} readings fit")
            step = -np.linalg.solve(system, side)
            turn = np.eye(4)
            turn[:3, :3], turn[:3, 3] = Rotation.from_rotvec(step[:3]).as_matrix(), step[3:]
            transform = turn @ transform
            if np.abs(step).max() < SMALL_STEP:
                break
    points, brightness, total = _readings(source, 1)
    _, _, count, information = _sums(points, brightness, target, camera, transform, max_jump)
    return RgbdAlignment(transform, information, count / max(total, 1))


def _readings(frame: RgbdFrame, stride: int) -> tuple[FloatArray, FloatArray, int]:
    points, brightness = frame.points[::stride, ::stride], frame.brightness[::stride, ::stride]
    known = points[..., 2] > 0
    return points[known], brightness[known], int(known.sum())


def _sums(
    points: FloatArray,
    brightness: FloatArray,
    target: RgbdFrame,
    camera: Intrinsics,
    transform: FloatArray,
    jump: float,
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """Normal equations (6, 6) and (6,), fitting readings, and the information of their positions (6, 6)."""
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    total = _accumulate(
        points, brightness, target.points, target.normals, target.brightness, target.slope, lens, transform, jump
    )
    return total[:36].reshape(6, 6), total[36:42], float(total[42]), total[43:].reshape(6, 6)


@njit(cache=True, nogil=True)
def _accumulate(points, brightness, surface, normals, image, slope, lens, transform, jump):  # type: ignore[no-untyped-def]  # Numba
    height, width = image.shape
    part = np.zeros(79)
    row = np.empty(6)
    for n in range(len(points)):
        p = points[n]
        x = transform[0, 0] * p[0] + transform[0, 1] * p[1] + transform[0, 2] * p[2] + transform[0, 3]
        y = transform[1, 0] * p[0] + transform[1, 1] * p[1] + transform[1, 2] * p[2] + transform[1, 3]
        z = transform[2, 0] * p[0] + transform[2, 1] * p[1] + transform[2, 2] * p[2] + transform[2, 3]
        if z <= 0:
            continue
        u, v = lens[0] * x / z + lens[2], lens[1] * y / z + lens[3]
        i, j = int(np.floor(u)), int(np.floor(v))
        if i < 0 or j < 0 or i + 1 >= width or j + 1 >= height:
            continue
        column, line = int(np.round(u)), int(np.round(v))
        q, normal = surface[line, column], normals[line, column]
        if q[2] == 0 or abs(q[2] - z) > jump or (normal[0] == 0 and normal[1] == 0 and normal[2] == 0):
            continue
        part[42] += 1
        error = normal[0] * (x - q[0]) + normal[1] * (y - q[1]) + normal[2] * (z - q[2])
        row[0], row[1], row[2] = (
            y * normal[2] - z * normal[1],
            z * normal[0] - x * normal[2],
            x * normal[1] - y * normal[0],
        )
        row[3], row[4], row[5] = normal[0], normal[1], normal[2]
        _add(part, row, error, DEPTH_SIGMA * z * z)
        s, t = u - i, v - j
        shade = (1 - t) * ((1 - s) * image[j, i] + s * image[j, i + 1]) + t * (
            (1 - s) * image[j + 1, i] + s * image[j + 1, i + 1]
        )
        gu = ((1 - s) * slope[line, i, 0] + s * slope[line, i + 1, 0]) * lens[0] / z
        gv = ((1 - t) * slope[j, column, 1] + t * slope[j + 1, column, 1]) * lens[1] / z
        gz = -(gu * x + gv * y) / z
        _set_row(row, x, y, z, gu, gv, gz)
        _add(part, row, shade - brightness[n], BRIGHTNESS_SIGMA)
        _add_position(part, x, y, z)
    return part


@njit(cache=True, nogil=True)
def _set_row(row, x, y, z, a, b, c):  # type: ignore[no-untyped-def]  # typed by Numba
    """Derivative of a residual whose gradient at point p is g: (p × g, g) for a small (rotation, translation)."""
    row[0], row[1], row[2] = y * c - z * b, z * a - x * c, x * b - y * a
    row[3], row[4], row[5] = a, b, c


@njit(cache=True, nogil=True)
def _add(part, row, error, sigma):  # type: ignore[no-untyped-def]  # typed by Numba
    """Add one residual with its row of the Jacobian to the normal equations."""
    size = abs(error) / sigma
    weight = (1.0 if size <= HUBER else HUBER / size) / (sigma * sigma)
    for a in range(6):
        for b in range(6):
            part[6 * a + b] += weight * row[a] * row[b]
        part[36 + a] += weight * row[a] * error


@njit(cache=True, nogil=True)
def _add_position(part, x, y, z):  # type: ignore[no-untyped-def]  # typed by Numba
    """Add JᵀJ of a point's position, J = (-[p]ₓ, I): Choi et al. 2015, eq. 10."""
    cross = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
    for axis in range(3):
        for a in range(3):
            for b in range(3):
                part[43 + 6 * a + b] += cross[axis][a] * cross[axis][b]
            part[43 + 6 * a + 3 + axis] += cross[axis][a]
            part[43 + 6 * (3 + axis) + a] += cross[axis][a]
        part[43 + 6 * (3 + axis) + 3 + axis] += 1.0
