"""Jerks that no person makes are smoothed away: captured joints that slip, frames that are missing.

Only about a jerk are turns of joints and the way of the root smoothed, and only as much as it takes: elsewhere a motion
stays as it was recorded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, maximum_filter1d

from vto_pipeline.avatar.motion.figures import jerked_joints
from vto_pipeline.avatar.motion.foot_skate import hold_feet
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.plants import runs
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.numerics.kinematics import (
    continuous_signs,
    local_rotations,
    matrix_quaternions,
    matrix_vectors,
    quaternion_matrices,
    vector_matrices,
)

_FIRST_S, _GROWTH, _ROUNDS = 0.01, 1.5, 8
"""In each round jerks that are left are smoothed over more time: in the last over a sixth of a second."""
_HELD_ROUNDS = 3
"""After which a foot that is jerked as it comes to stand, or as it leaves, stands for a shorter time."""
_SHORTER_S = 0.017


def calm(avatar: Avatar, poses: FloatArray, root: FloatArray, frame_time: float) -> tuple[FloatArray, FloatArray]:
    """Return poses and places of the root in which no joint is jerked, shapes (T, J, 3) and (T, 3).

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
        frame_time: [s].
    """
    for again in range(_ROUNDS):
        jerked = jerked_joints(posed_joints(avatar, poses, root)[1], frame_time)
        if not jerked.any():
            break
        poses, root = _smoothed(poses, root, np.any(jerked, axis=1), frame_time, again)
    return poses, root


def calm_on_held_feet(
    avatar: Avatar, poses: FloatArray, root: FloatArray, planted: NDArray[np.bool_], frame_time: float
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return the same, with feet that are held where they stand, and when they do.

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
        planted: Which of `model.motion.CONTACTS` stand still, shape (T, 4).
        frame_time: [s].
    """
    for again in range(_ROUNDS + 1):
        turn, place = posed_joints(avatar, poses, root)
        turn, root = hold_feet(turn, place, planted, avatar, frame_time)
        poses = matrix_vectors(local_rotations(avatar.parents.tolist(), turn))
        jerked = jerked_joints(posed_joints(avatar, poses, root)[1], frame_time)
        if not jerked.any() or again == _ROUNDS:
            break
        if again >= _HELD_ROUNDS:
            planted = _shorter(planted, jerked, avatar, max(1, round(_SHORTER_S / frame_time)))
        poses, root = _smoothed(poses, root, np.any(jerked, axis=1), frame_time, again)
    return poses, root, planted


def _shorter(planted: NDArray[np.bool_], jerked: NDArray[np.bool_], avatar: Avatar, count: int) -> NDArray[np.bool_]:
    """Return plants without so many frames at an end near which the ankle or the knee is jerked, shape (T, 4)."""
    shorter = planted.copy()
    for k, side in enumerate(("left", "right")):
        leg = jerked[:, [avatar.joint_names.index(f"{side}_{joint}") for joint in ("knee", "ankle")]].any(axis=1)
        near = maximum_filter1d(leg, 2 * count + 1, mode="constant")
        for contact in (2 * k, 2 * k + 1):
            for first, end in runs(planted[:, contact]):
                if near[first]:
                    shorter[first : first + count, contact] = False
                if near[end - 1]:
                    shorter[end - count : end, contact] = False
    return shorter


def _smoothed(
    poses: FloatArray, root: FloatArray, frames: NDArray[np.bool_], frame_time: float, again: int
) -> tuple[FloatArray, FloatArray]:
    """Return poses and places that are smooth about these frames."""
    deviation = max(_FIRST_S / frame_time, 0.5) * _GROWTH**again
    share = _about(frames, max(1, round(2.0 * deviation)))[:, None]
    turns = continuous_signs(matrix_quaternions(vector_matrices(poses)))
    turns = turns + share[..., None] * (_mean(turns, deviation) - turns)
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    return matrix_vectors(quaternion_matrices(turns)), root + share * (_mean(root, deviation) - root)


def _about(frames: NDArray[np.bool_], reach: int) -> FloatArray:
    """Return 1 so many frames on either side of those frames, falling to 0 over as many more, shape (T,)."""
    window = np.hanning(2 * reach + 3)[1:-1]
    near = maximum_filter1d(frames.astype(float), 4 * reach + 1, mode="constant")
    share: FloatArray = convolve1d(near, window / window.sum(), mode="nearest")
    return share


def _mean(values: FloatArray, deviation: float) -> FloatArray:
    """Return means over time, weighted by Gauss's bell of this deviation in frames; straight lines stay as they are."""
    reach = min(int(np.ceil(4.0 * deviation)), len(values) - 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    around = [(reach, reach)] + [(0, 0)] * (values.ndim - 1)
    longer = np.pad(values, around, mode="reflect", reflect_type="odd")
    mean: FloatArray = convolve1d(longer, weights / weights.sum(), axis=0)[reach : reach + len(values)]
    return mean
