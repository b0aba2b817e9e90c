"""Feet that stand still are held where they stand.

After Kovar, Schreiner & Gleicher 2002, "Footskate cleanup for motion capture editing": each plant gets one place, the
root is lowered where a leg would not reach, legs are bent in closed form, and corrections fade out in the frames
before and after. No bone changes its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from vto_pipeline.avatar.motion.leg_reach import lowering, two_bones
from vto_pipeline.avatar.motion.plants import runs
from vto_pipeline.avatar.motion.soles import contact_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.numerics.kinematics import matrix_vectors, shortest_rotations, vector_matrices

_SIDES = ("left", "right")
_FADE_S = 0.25
_LOWER_S = 0.15
_HINGE_S = 0.1
_SIDEWAYS = 0.15
"""Weight of the thigh's own axis beside the sine of the knee's bend."""

_REACH = 0.99
"""Share of the straight leg that a planted foot may need: knees that snap straight jerk."""


@dataclass(frozen=True)
class Held:
    """Where an ankle and its foot are to be.

    Args:
        turn: World rotation of the foot relative to the bind pose, shape (T, 3, 3).
        ankle: [m], shape (T, 3).
    """

    turn: FloatArray
    ankle: FloatArray


def hold_feet(
    turn: FloatArray, place: FloatArray, planted: NDArray[np.bool_], avatar: Avatar, frame_time: float
) -> tuple[FloatArray, FloatArray]:
    """Return rotations and places of the root of a motion whose planted feet stand still.

    Args:
        turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
        place: World places of the joints [m], shape (T, J, 3).
        planted: Which of `model.motion.CONTACTS` stand still, shape (T, 4).
        avatar: Whose.
        frame_time: [s].
    """
    points = contact_points(avatar)
    fade = max(1, round(_FADE_S / frame_time))
    held = []
    for k, side in enumerate(_SIDES):
        ankle, where = avatar.joint_names.index(f"{side}_ankle"), slice(2 * k, 2 * k + 2)
        held.append(_hold(turn[:, ankle], place[:, ankle], planted[:, where], points[where], fade))
    return reach_for(turn, place, held, avatar, frame_time)


def reach_for(
    turn: FloatArray, place: FloatArray, held: Sequence[Held], avatar: Avatar, frame_time: float
) -> tuple[FloatArray, FloatArray]:
    """Return rotations and places of the root of a motion whose feet are where they are to be.

    Args:
        turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
        place: World places of the joints [m], shape (T, J, 3).
        held: Left and right foot.
        avatar: Whose.
        frame_time: [s].
    """
    turn, names, drop = turn.copy(), avatar.joint_names, np.zeros(len(turn))
    for side, goal in zip(_SIDES, held, strict=True):
        length = _REACH * sum(np.linalg.norm(bone) for bone in _bones(avatar, side))
        way = goal.ankle - place[:, names.index(f"{side}_hip")]
        level = np.minimum(way[:, 0] ** 2 + way[:, 2] ** 2, length**2)
        need = np.maximum(-way[:, 1] - np.sqrt(length**2 - level), 0.0)
        drop = np.maximum(drop, need)
    drop = lowering(drop, round(_LOWER_S / frame_time))
    root = place[:, names.index("pelvis")] - drop[:, None] * [0.0, 1.0, 0.0]
    for side, goal in zip(_SIDES, held, strict=True):
        hip, knee, ankle = (names.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle"))
        thigh, shank = _bones(avatar, side)
        first, second = two_bones(
            place[:, hip] - drop[:, None] * [0.0, 1.0, 0.0],
            goal.ankle,
            turn[:, hip] @ thigh,
            turn[:, knee] @ shank,
            _hinge(turn[:, hip], turn[:, knee], thigh, shank, round(_HINGE_S / frame_time)),
        )
        turn[:, hip], turn[:, knee] = first @ turn[:, hip], second @ turn[:, knee]
        turn[:, ankle] = goal.turn
    return turn, root


def grounded(planted: NDArray[np.bool_], frame_time: float) -> FloatArray:
    """Return how much the left and the right foot stand: 1 while they do, 0 a while before and after, shape (T, 2).

    Args:
        planted: Which of `model.motion.CONTACTS` stand still, shape (T, 4).
        frame_time: [s].
    """
    fade, one = max(1, round(_FADE_S / 2 / frame_time)), np.ones((len(planted), 1))
    return np.concatenate([fade_out(one, np.any(planted[:, k : k + 2], axis=1), fade) for k in (0, 2)], axis=1)


def _bones(avatar: Avatar, side: str) -> tuple[FloatArray, FloatArray]:
    hip, knee, ankle = (
        avatar.joints[avatar.joint_names.index(f"{side}_{joint}")] for joint in ("hip", "knee", "ankle")
    )
    return knee - hip, ankle - knee


def _hold(turn: FloatArray, ankle: FloatArray, planted: NDArray[np.bool_], points: FloatArray, fade: int) -> Held:
    """One foot. `planted` and `points` are those of its heel and ball."""
    flat, either = np.all(planted, axis=1), np.any(planted, axis=1)
    level = np.tile(np.eye(3), (len(turn), 1, 1))
    anchor = np.zeros((len(turn), 2, 3))
    world = ankle[:, None] + np.einsum("tab,cb->tca", turn, points)
    for first, end in runs(either):
        span = slice(first, end)
        level[span], anchor[span] = _stance(turn[span], world[span], planted[span], points)
    correction = matrix_vectors(level @ np.swapaxes(turn, -1, -2))
    turn = vector_matrices(fade_out(correction, flat, fade)) @ turn
    turn = vector_matrices(fade_out(_dips(turn, planted, points), either, fade)) @ turn
    goal = anchor - np.einsum("tab,cb->tca", turn, points)
    wanted = np.where(planted[:, :1], goal[:, 0], goal[:, 1])
    ankle = ankle + fade_out(wanted - ankle, either, fade)
    sunk = _sunk(turn, ankle, points)
    lift = lowering(np.where(either, 0.0, sunk), fade // 3)
    near = fade_out(np.ones((len(lift), 1)), either, max(1, fade // 2))[:, 0]
    ankle = ankle + ((1.0 - near) * lift)[:, None] * [0.0, 1.0, 0.0]
    ankle = ankle + np.where(either, 0.0, _sunk(turn, ankle, points))[:, None] * [0.0, 1.0, 0.0]
    return Held(turn, ankle)


def _sunk(turn: FloatArray, ankle: FloatArray, points: FloatArray) -> FloatArray:
    """Return how far heel or ball of a foot are below the floor [m], shape (T,)."""
    lowest = (ankle[:, None, 1] + np.einsum("tb,cb->tc", turn[:, 1], points)).min(axis=1)
    sunk: FloatArray = np.maximum(-lowest, 0.0)
    return sunk


def _stance(
    turn: FloatArray, world: FloatArray, planted: NDArray[np.bool_], points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the level foot (3, 3), and where heel and ball stand (2, 3), while a foot is on the floor."""
    flat = planted.all(axis=1)
    some = flat if flat.any() else planted.any(axis=1)
    ahead = turn[some, :, 2].mean(axis=0)
    yaw = np.arctan2(ahead[0], ahead[2])
    level = vector_matrices(np.array([0.0, yaw, 0.0]))
    if flat.any():
        middle = world[flat].mean(axis=(0, 1))
        anchor = middle + (points - points.mean(axis=0)) @ level.T
    else:
        anchor = np.zeros((2, 3))
        for c in np.flatnonzero(planted.any(axis=0)):
            anchor[c] = world[planted[:, c], c].mean(axis=0)
    anchor[:, 1] = 0.0
    return level, anchor


def _dips(turn: FloatArray, planted: NDArray[np.bool_], points: FloatArray) -> FloatArray:
    """Rotation vectors that level a foot on its heel or its ball whose other end would dip into the floor, (T, 3)."""
    found = np.zeros((len(turn), 3))
    for c, sign in ((0, 1.0), (1, -1.0)):
        way = sign * np.einsum("tab,b->ta", turn, points[1] - points[0])
        dips = planted[:, c] & ~planted[:, 1 - c] & (way[:, 1] < 0)
        if dips.any():
            found[dips] = matrix_vectors(shortest_rotations(way[dips], way[dips] * [1.0, 0.0, 1.0]))
    return found


def _hinge(hip: FloatArray, knee: FloatArray, thigh: FloatArray, shank: FloatArray, reach: int) -> FloatArray:
    """Return what each knee bends about: across thigh and shank, and where they are in line, across the thigh.

    Smooth in the thigh's own frame: an almost straight knee has a plane, but not a steady one.

    Args:
        hip: World rotation of the thigh, shape (T, 3, 3).
        knee: Of the shank.
        thigh: From hip to knee in the bind pose, shape (3,).
        shank: From knee to ankle in the bind pose, shape (3,).
        reach: Half the window of the mean, in frames.
    """
    u = thigh / np.linalg.norm(thigh)
    w = np.einsum("tba,tbc,c->ta", hip, knee, shank / np.linalg.norm(shank))
    bend = np.cross(np.broadcast_to(u, w.shape), w)
    forward = np.maximum(bend[:, :1], 0.0) / np.maximum(np.linalg.norm(bend, axis=1, keepdims=True), 1e-12)
    normal = forward * bend + _SIDEWAYS * np.array([1.0, 0.0, 0.0])
    weights = np.hanning(2 * reach + 3)[1:-1]
    normal = convolve1d(normal, weights / weights.sum(), axis=0, mode="nearest")
    normal = np.einsum("tab,tb->ta", hip, normal)
    unit: FloatArray = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return unit


def fade_out(values: FloatArray, known: NDArray[np.bool_], reach: int) -> FloatArray:
    """Return values where they are known, fading to zero or to the next known ones over a number of frames.

    Cubic Hermite curves that leave the known values with their slope (Kovar et al. 2002, section 4.3, has no slope:
    a foot would then start with a jerk).

    Args:
        values: Shape (T, N).
        known: Shape (T,).
        reach: In frames.
    """
    faded = np.where(known[:, None], values, 0.0)
    for first, end in runs(~known):
        gap = min(reach, end - first + 1)
        steps = np.arange(1, end - first + 1)
        for edge, inward, away in ((first - 1, -1, steps), (end, 1, steps[::-1])):
            if not 0 <= edge < len(known):
                continue
            before = edge + inward
            slope = values[edge] - values[before] if 0 <= before < len(known) and known[before] else 0.0 * values[edge]
            s = np.minimum(away / gap, 1.0)[:, None]
            faded[first:end] += (2 * s**3 - 3 * s**2 + 1) * values[edge] + gap * (s**3 - 2 * s**2 + s) * slope
    return faded
