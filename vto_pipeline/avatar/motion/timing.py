"""Another frame rate, and a smooth start from a pose."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion, Clip
from vto_pipeline.numerics.kinematics import continuous_signs, matrix_vectors, vector_matrices

_MOST_FRAMES = 200_000


def resample(clip: Clip, frames_per_second: float) -> Clip:
    """Return a clip at another rate, first and last frame within one frame of where they were.

    Cubic splines through places and quaternions, which are then brought to unit length: velocities stay smooth.

    Args:
        clip: Any.
        frames_per_second: The new rate.

    Raises:
        InputError: more than 200,000 frames would come out.
    """
    count = int(np.floor(clip.seconds * frames_per_second + 1e-9)) + 1
    if count > _MOST_FRAMES:
        raise InputError(f"{count} frames at {frames_per_second:g} a second; at most {_MOST_FRAMES} are made")
    if len(clip.rotations) == 1:
        return replace(clip, frame_time=1.0 / frames_per_second)
    times = np.arange(len(clip.rotations)) * clip.frame_time
    wanted = np.minimum(np.arange(count) / frames_per_second, times[-1])
    rotations = CubicSpline(times, continuous_signs(clip.rotations))(wanted)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    translations = CubicSpline(times, clip.translations)(wanted)
    return replace(clip, rotations=rotations, translations=translations, frame_time=1.0 / frames_per_second)


def lead_in(motion: AvatarMotion, avatar: Avatar, seconds: float) -> AvatarMotion:
    """Return a motion that begins in the avatar's own pose, at rest, and reaches the first frame at its speed.

    The motion is turned and moved so that it begins where the avatar stands and faces. Each joint follows a cubic
    Hermite curve in the rotation from its start. Feet slide meanwhile: they are not planted.

    Args:
        motion: Of this avatar.
        avatar: In the pose to begin with.
        seconds: Time from there to the first frame.
    """
    count = max(1, round(seconds / motion.frame_time))
    poses, translations = brought_to(motion, avatar)
    second = min(1, len(poses) - 1)
    start = vector_matrices(avatar.pose)
    first, after = (matrix_vectors(vector_matrices(poses[k]) @ np.swapaxes(start, -1, -2)) for k in (0, second))
    ways = np.concatenate([first, (translations[0] - avatar.translation)[None]])
    next_ways = np.concatenate([after, (translations[second] - avatar.translation)[None]])
    slopes = (next_ways - ways) * count  # per whole lead-in
    s = (np.arange(count) / count)[:, None, None]
    path = (3 * s**2 - 2 * s**3) * ways + (s**3 - s**2) * slopes
    turned = vector_matrices(path[:, :-1]) @ start
    return replace(
        motion,
        poses=np.concatenate([matrix_vectors(turned), poses]),
        translations=np.concatenate([avatar.translation + path[:, -1], translations]),
        planted=np.concatenate([np.zeros((count, motion.planted.shape[1]), dtype=bool), motion.planted]),
    )


def brought_to(motion: AvatarMotion, avatar: Avatar) -> tuple[FloatArray, FloatArray]:
    """Return poses and translations, turned about the vertical and moved on the floor to where the avatar stands."""
    root = avatar.joint_names.index("pelvis")
    turns = vector_matrices(motion.poses[:, root])
    yaws = [np.arctan2(turn[0, 2], turn[2, 2]) for turn in (vector_matrices(avatar.pose[root]), turns[0])]
    swing = vector_matrices(np.array([0.0, yaws[0] - yaws[1], 0.0]))
    poses = motion.poses.copy()
    poses[:, root] = matrix_vectors(swing @ turns)
    pivot = avatar.joints[root]
    places = (motion.translations + pivot) @ swing.T
    places += (avatar.translation + pivot - places[0]) * [1.0, 0.0, 1.0]
    return poses, places - pivot


def hold_last(motion: AvatarMotion, seconds: float) -> AvatarMotion:
    """Return a motion whose last pose is held for so long [s]."""
    count = round(seconds / motion.frame_time)

    def held(values: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([values, np.repeat(values[-1:], count, axis=0)])

    return replace(
        motion,
        poses=held(motion.poses),
        translations=held(motion.translations),
        planted=held(motion.planted),
    )
