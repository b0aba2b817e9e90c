"""How clean a motion is: drift of planted feet, spikes, depth below the floor, limbs that cross."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.plants import runs
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion

_SPIKE_M_S2, _SPIKE_RATIO, _AROUND_S = 40.0, 8.0, 0.2
_APART = 2
"""Parts whose joints are farther apart in the skeleton than this never touch where one bends into the next."""
_LEAP_M = 0.05


class Leap(NamedTuple):
    """A joint that is not where it was going.

    Args:
        frame: In which.
        joint: Which.
        distance: How far it is off its course [m].
    """

    frame: int
    joint: int
    distance: float


def plant_drift(places: FloatArray, planted: NDArray[np.bool_]) -> float:
    """Return how far a planted point strays from the middle of its plant, at most [m]; 0 where nothing is planted.

    Args:
        places: Of the points [m], shape (T, N, 3).
        planted: Shape (T, N).
    """
    worst = 0.0
    for n in range(places.shape[1]):
        for first, end in runs(planted[:, n]):
            there = places[first:end, n]
            worst = max(worst, float(np.linalg.norm(there - there.mean(axis=0), axis=1).max()))
    return worst


def spikes(places: FloatArray, frame_time: float) -> int:
    """Return in how many frames a joint is jerked: faster than 40 m/s² and 8 times as much as just before and after.

    Args:
        places: Of the joints [m], shape (T, J, 3).
        frame_time: [s].
    """
    return int(jerked_joints(places, frame_time).any(axis=1).sum())


def jerked_joints(places: FloatArray, frame_time: float) -> NDArray[np.bool_]:
    """Return which joints are jerked in which frames, shape (T, J); see `spikes`."""
    jerked = np.zeros(places.shape[:2], dtype=bool)
    jerked[1:-1] = _jerked(_off_course(places), frame_time)
    return jerked


def worst_leap(places: FloatArray, frame_time: float) -> Leap | None:
    """Return where a joint is jerked the farthest off its course; None where that is nowhere by more than 50 mm.

    Args:
        places: Of the joints [m], shape (T, J, 3).
        frame_time: [s].
    """
    off = _off_course(places)
    far = np.where(_jerked(off, frame_time), off, 0.0)
    if far.max(initial=0.0) < _LEAP_M:
        return None
    row, joint = np.unravel_index(np.argmax(far), far.shape)
    return Leap(int(row) + 2, int(joint), float(far[row, joint]))


def _off_course(places: FloatArray) -> FloatArray:
    """Return how far joints are in each frame, from the third, from where their speed led [m], shape (T - 2, J)."""
    off: FloatArray = np.linalg.norm(np.diff(places, 2, axis=0), axis=-1)
    return off


def _jerked(off: FloatArray, frame_time: float) -> NDArray[np.bool_]:
    """Return which of these are jerks, shape (T - 2, J); see `spikes`."""
    if len(off) < 3:
        return np.zeros(off.shape, np.bool_)
    window = max(5, 2 * round(_AROUND_S / frame_time) + 1)
    usual = median_filter(off, (min(window, len(off)), 1), mode="nearest")
    jerked: NDArray[np.bool_] = (off > _SPIKE_M_S2 * frame_time**2) & (off > _SPIKE_RATIO * usual)
    return jerked


def crossing_frames(motion: AvatarMotion, avatar: Avatar, count: int) -> tuple[int, int]:
    """Return in how many of some evenly spaced frames an arm or leg passes through another part, and of how many.

    Skin that folds at a joint, and what passes through itself in the bind pose, does not count.

    Args:
        motion: Of this avatar.
        avatar: Any of our bodies.
        count: Frames looked at, at most.
    """
    owner = np.argmax(avatar.weights, axis=1)[avatar.faces[:, 0]]
    apart = _steps(avatar)
    frames = np.unique(np.linspace(0, len(motion.poses) - 1, count).astype(int))
    crossing = 0
    for t in frames:
        posed = pose_avatar(avatar, motion.poses[t], motion.translations[t])
        pairs = np.asarray(self_intersections(posed.mesh))
        crossing += bool(len(pairs) and (apart[owner[pairs[:, 0]], owner[pairs[:, 1]]] > _APART).any())
    return crossing, len(frames)


def _steps(avatar: Avatar) -> NDArray[np.int64]:
    """Bones between each pair of joints, shape (J, J)."""
    above = []
    for j in range(len(avatar.parents)):
        chain = [j]
        while avatar.parents[chain[-1]] >= 0:
            chain.append(int(avatar.parents[chain[-1]]))
        above.append(chain)
    return np.array([[len(set(a) ^ set(b)) for b in above] for a in above])
