"""Another frame rate, a smooth start from a pose, and a smooth end."""

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
from vto_pipeline.numerics.kinematics import (
    continuous_signs,
    matrix_vectors,
    vector_matrices,
)

_MOST_FRAMES = 200_000
_SET_OUT_S = 0.4
"""In which a motion that begins at rest reaches its speed, and in which it comes to rest."""


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
    """Return a motion from the avatar's own pose to the first frame, from rest there to its end, and to rest there.

    The motion is turned and moved so that it begins where the avatar stands and faces. Each joint goes the shortest
    way to the first frame and stops there. A curve that arrived at the frame's speed would have to swing back for a
    run-up, far beyond both poses. So the next frames are slowed instead, until the motion is at its speed, and so are
    the last. Feet slide on the way to the first frame: they are not planted.

    Args:
        motion: Of this avatar.
        avatar: In the pose to begin with.
        seconds: Time from there to the first frame.
    """
    count = max(1, round(seconds / motion.frame_time))
    poses, translations = brought_to(motion, avatar)
    start = vector_matrices(avatar.pose)
    way = matrix_vectors(vector_matrices(poses[0]) @ np.swapaxes(start, -1, -2))
    s = np.arange(count) / count
    share = (3 * s**2 - 2 * s**3)[:, None, None]
    turned = vector_matrices(share * way) @ start
    moved = avatar.translation + share[:, 0] * (translations[0] - avatar.translation)
    whole = _from_rest(_backward(_from_rest(_backward(replace(motion, poses=poses, translations=translations)))))
    return replace(
        motion,
        poses=np.concatenate([matrix_vectors(turned), whole.poses]),
        translations=np.concatenate([moved, whole.translations]),
        planted=np.concatenate([np.zeros((count, motion.planted.shape[1]), dtype=bool), whole.planted]),
    )


def _from_rest(motion: AvatarMotion) -> AvatarMotion:
    """Return a motion that starts at rest: its speed grows evenly, and all of its poses are passed.

    Between two frames joints turn at even speed, as `path` has it: a spline's feet would drift where one of them begins
    to stand still. A point stands still there if it does in both frames.
    """
    last = len(motion.poses) - 1
    slowed = 2 * min(round(_SET_OUT_S / 2 / motion.frame_time), last)  # even: it ends on a frame of the motion
    if slowed == 0:
        return motion
    at = np.arange(slowed) ** 2 / (2 * slowed)
    before, after, rest = np.floor(at).astype(int), np.ceil(at).astype(int), slice(slowed // 2, None)
    share, turns = (at - before)[:, None, None], vector_matrices(motion.poses)
    way = matrix_vectors(turns[after] @ np.swapaxes(turns[before], -1, -2))
    poses = matrix_vectors(vector_matrices(share * way) @ turns[before])
    places = motion.translations
    places = places[before] + share[:, 0] * (places[after] - places[before])
    return replace(
        motion,
        poses=np.concatenate([poses, motion.poses[rest]]),
        translations=np.concatenate([places, motion.translations[rest]]),
        planted=np.concatenate([motion.planted[before] & motion.planted[after], motion.planted[rest]]),
    )


def _backward(motion: AvatarMotion) -> AvatarMotion:
    return replace(
        motion, poses=motion.poses[::-1], translations=motion.translations[::-1], planted=motion.planted[::-1]
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
