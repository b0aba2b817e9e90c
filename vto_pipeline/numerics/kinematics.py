"""Forward kinematics of skeletons over many frames, and the rotations it needs."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]


def world_transforms(parents: Iterable[int], rotations: Floats, translations: Floats) -> tuple[Floats, Floats]:
    """Return the world rotation and place of each joint, shapes (T, J, 3, 3) and (T, J, 3).

    Args:
        parents: Index of each joint's parent, which comes before it; -1 for a root.
        rotations: In the parents' frames, shape (T, J, 3, 3).
        translations: The joints in the parents' frames [m], shape (T, J, 3) or (J, 3).
    """
    turn = np.empty_like(rotations)
    place = np.empty(rotations.shape[:-1])
    local = np.broadcast_to(translations, place.shape)
    for j, parent in enumerate(parents):
        if parent < 0:
            turn[:, j], place[:, j] = rotations[:, j], local[:, j]
        else:
            turn[:, j] = turn[:, parent] @ rotations[:, j]
            place[:, j] = np.einsum("tab,tb->ta", turn[:, parent], local[:, j]) + place[:, parent]
    return turn, place


def local_rotations(parents: Iterable[int], turn: Floats) -> Floats:
    """Return rotations in the parents' frames of those in the world, shape (T, J, 3, 3)."""
    local = turn.copy()
    for j, parent in enumerate(parents):
        if parent >= 0:
            local[:, j] = np.swapaxes(turn[:, parent], -1, -2) @ turn[:, j]
    return local


def quaternion_matrices(quaternions: Floats) -> Floats:
    """Return rotation matrices of quaternions (x, y, z, w), shape (..., 3, 3)."""
    flat = np.array(quaternions, dtype=float).reshape(-1, 4)  # a copy: it refuses read-only arrays
    matrices: Floats = Rotation.from_quat(flat).as_matrix().reshape(*quaternions.shape[:-1], 3, 3)
    return matrices


def matrix_quaternions(matrices: Floats) -> Floats:
    """Return quaternions (x, y, z, w) of rotation matrices, shape (..., 4)."""
    flat = np.array(matrices, dtype=float).reshape(-1, 3, 3)
    quaternions: Floats = Rotation.from_matrix(flat).as_quat().reshape(*matrices.shape[:-2], 4)
    return quaternions


def vector_matrices(vectors: Floats) -> Floats:
    """Return rotation matrices of rotation vectors [rad], shape (..., 3, 3)."""
    flat = np.array(vectors, dtype=float).reshape(-1, 3)
    matrices: Floats = Rotation.from_rotvec(flat).as_matrix().reshape(*vectors.shape[:-1], 3, 3)
    return matrices


def matrix_vectors(matrices: Floats) -> Floats:
    """Return rotation vectors [rad] of rotation matrices, shape (..., 3)."""
    flat = np.array(matrices, dtype=float).reshape(-1, 3, 3)
    vectors: Floats = Rotation.from_matrix(flat).as_rotvec().reshape(*matrices.shape[:-2], 3)
    return vectors


def continuous_signs(quaternions: Floats) -> Floats:
    """Return quaternions each of which lies on the side of the one before; q and -q are one rotation.

    Args:
        quaternions: Along the first axis, shape (T, ..., 4).
    """
    turned = (quaternions[1:] * quaternions[:-1]).sum(axis=-1, keepdims=True) < 0
    signs = np.cumprod(np.where(turned, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs])


def shortest_rotations(start: Floats, end: Floats) -> Floats:
    """Return the smallest rotations that turn directions into others, shape (..., 3, 3).

    Args:
        start: Directions of any length above 0, shape (..., 3).
        end: The same.
    """
    a = start / np.linalg.norm(start, axis=-1, keepdims=True)
    b = end / np.linalg.norm(end, axis=-1, keepdims=True)
    a, b = np.broadcast_arrays(a, b)
    cosine = (a * b).sum(axis=-1)
    axis = _cross(a, b)
    # half a turn has no axis of its own: take any across
    across = np.where(abs(a[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    across = _cross(a, across)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    opposite = (length < 1e-12) & (cosine[..., None] < 0)
    axis = np.where(opposite, across, axis)
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    angle = np.arctan2(np.where(opposite, 0.0, length), cosine[..., None])
    return vector_matrices(axis / np.maximum(length, 1e-300) * angle)


def _cross(a: Floats, b: Floats) -> Floats:
    """Return cross products along the last axis; for a few vectors NumPy's checks take longer than the product."""
    product: Floats = a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]
    return product
