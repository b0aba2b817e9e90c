"""Rigid alignment of two depth frames by shape and colour.

From the same start, Open3D's Hybrid odometry errs about twice as much (`tests/scan/test_rgbd_alignment.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame

DEPTH_SIGMA, BRIGHTNESS_SIGMA = 0.0015, 0.03
"""Noise of a reading at 1 m, growing with its square [m]; noise of brightness, on a scale from 0 to 1."""

HUBER = 1.5
"""Residuals beyond this many sigmas count linearly."""

FACING = 0.6
"""Least cosine between the normals of matched surface points."""

SMALL_STEP = 1e-5
"""A pass ends when the motion changes by less than this [rad, m]."""

STRIDES, STEPS = (4, 2, 1), (8, 8, 8)
"""Every n-th pixel of the source in each pass, and Gauss-Newton steps of the pass at most."""

FEWEST = 100
"""Points that must fit."""


@dataclass(frozen=True)
class RgbdAlignment:
    """Result of `align_frames`.

    Args:
        target_from_source: Rigid transform, shape (4, 4).
        information: Inverse covariance of (rotation, translation) up to a common factor, shape (6, 6).
        overlap: Share of the source's points that fell on the target's surface.
    """

    target_from_source: FloatArray
    information: FloatArray
    overlap: float


@dataclass(frozen=True)
class PairSums:
    """Normal equations of one motion step of a pair, (rotation, translation) in the target's frame.

    Args:
        matrix: Shape (6, 6).
        side: Shape (6,).
        fitting: Points of the source that fell on the target's surface.
        points: Points of the source that fell into the target's picture or not.
        information: Of the fitting points' positions, shape (6, 6): Choi et al. 2015, eq. 10.
    """

    matrix: FloatArray
    side: FloatArray
    fitting: int
    points: int
    information: FloatArray


def align_frames(source: RgbdFrame, target: RgbdFrame, start: FloatArray, max_jump: float) -> RgbdAlignment:
    """Align by point-to-plane distance and brightness together, Gauss-Newton with Huber weights.

    Park et al. 2017 (joint photometric and geometric objective), with projective association (Newcombe et al. 2011).

    Args:
        source, target: Frames of one camera.
        start: First guess of target_from_source, shape (4, 4).
        max_jump: Points further than this from the target's surface do not count [m].

    Raises:
        ScanError: too little overlap to fix the motion.
    """
    transform = np.array(start, dtype=np.float64)
    for stride, steps in zip(STRIDES, STEPS, strict=True):
        for _ in range(steps):
            sums = pair_sums(source, target, transform, max_jump, stride)
            if sums.fitting < FEWEST / stride or not np.linalg.cond(sums.matrix) < 1e12:
                raise ScanError(f"lost track: {sums.fitting} of {sums.points} points fit")
            step = np.asarray(-np.linalg.solve(sums.matrix, sums.side), dtype=np.float64)
            transform = small_motion(step) @ transform
            if np.abs(step).max() < SMALL_STEP:
                break
    sums = pair_sums(source, target, transform, max_jump, 1)
    return RgbdAlignment(transform, sums.information, sums.fitting / max(sums.points, 1))


def small_motion(step: FloatArray) -> FloatArray:
    """Rigid transform by a rotation vector and a translation, shape (6,) to (4, 4)."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = Rotation.from_rotvec(step[:3]).as_matrix(), step[3:]
    return motion


def pair_sums(source: RgbdFrame, target: RgbdFrame, transform: FloatArray, max_jump: float, stride: int) -> PairSums:
    """Sum up what a pair says of its motion.

    Args:
        source, target: Frames of one camera.
        transform: target_from_source at which to linearise, shape (4, 4).
        max_jump: Points further than this from the target's surface do not count [m].
        stride: Every so many pixels of the source, along both axes.
    """
    camera = target.camera
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    total = _accumulate(
        source.depth, source.normals, source.brightness, target.depth, target.normals, target.brightness,
        lens, np.ascontiguousarray(transform), max_jump, stride,
    )  # fmt: skip
    return PairSums(total[:36].reshape(6, 6), total[36:42], int(total[42]), int(total[79]), total[43:79].reshape(6, 6))


@njit(cache=True, nogil=True)
def _accumulate(depth, facing, shade, surface, normals, image, lens, transform, jump, stride):  # type: ignore[no-untyped-def]  # Numba
    height, width = image.shape
    part = np.zeros(80)
    row = np.empty(6)
    for line in range(stride // 2, depth.shape[0], stride):
        for column in range(stride // 2, depth.shape[1], stride):
            far = depth[line, column]
            if far == 0:
                continue
            part[79] += 1
            px, py = (column - lens[2]) / lens[0] * far, (line - lens[3]) / lens[1] * far
            x = transform[0, 0] * px + transform[0, 1] * py + transform[0, 2] * far + transform[0, 3]
            y = transform[1, 0] * px + transform[1, 1] * py + transform[1, 2] * far + transform[1, 3]
            z = transform[2, 0] * px + transform[2, 1] * py + transform[2, 2] * far + transform[2, 3]
            if z <= 0:
                continue
            u, v = lens[0] * x / z + lens[2], lens[1] * y / z + lens[3]
            i, j = int(np.floor(u)), int(np.floor(v))
            if i < 0 or j < 0 or i + 1 >= width or j + 1 >= height:
                continue
            near_i, near_j = int(np.round(u)), int(np.round(v))
            q = surface[near_j, near_i]
            if q == 0 or abs(q - z) > jump:
                continue
            normal = normals[near_j, near_i]
            a = facing[line, column]
            cosine = 0.0
            for axis in range(3):
                turned = transform[axis, 0] * a[0] + transform[axis, 1] * a[1] + transform[axis, 2] * a[2]
                cosine += normal[axis] * turned
            if cosine < FACING:
                continue
            part[42] += 1
            qx, qy = (near_i - lens[2]) / lens[0] * q, (near_j - lens[3]) / lens[1] * q
            error = normal[0] * (x - qx) + normal[1] * (y - qy) + normal[2] * (z - q)
            _set_row(row, x, y, z, normal[0], normal[1], normal[2])
            _add(part, row, error, DEPTH_SIGMA * z * z)
            s, t = u - i, v - j
            right0, right1 = image[j, i + 1] - image[j, i], image[j + 1, i + 1] - image[j + 1, i]
            value = (1 - t) * (image[j, i] + s * right0) + t * (image[j + 1, i] + s * right1)
            gu = ((1 - t) * right0 + t * right1) * lens[0] / z
            gv = ((1 - s) * (image[j + 1, i] - image[j, i]) + s * (image[j + 1, i + 1] - image[j, i + 1])) * lens[1] / z
            _set_row(row, x, y, z, gu, gv, -(gu * x + gv * y) / z)
            _add(part, row, value - shade[line, column], BRIGHTNESS_SIGMA)
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
