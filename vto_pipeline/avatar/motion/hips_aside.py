"""Hips that move aside so that a body keeps its balance, over feet that stay where they are.

A body of another shape than the actor's carries its weight elsewhere. As in a cart that runs on a table (Kajita et al.
2003, "Biped walking pattern generation by using preview control of zero-moment point"), hips that are aside by d move
the zero moment point by d - d'' h / g, where h is the height of the centre of mass. So the way d that moves it by e(t)
into the support is e averaged over what has been and what will be, weighted by exp(-|t| √(g/h)).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solveh_banded

from vto_pipeline.avatar.motion.balance import PartMasses, balance, part_masses, part_middles
from vto_pipeline.avatar.motion.foot_skate import Held, reach_for
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors
from vto_pipeline.units import GRAVITY

_ROUNDS = 4
"""Feet and part of the legs do not move along, so that a round does some four fifths of what is wanted."""


def balanced(
    avatar: Avatar, poses: FloatArray, root: FloatArray, frame_time: float, within: float
) -> tuple[FloatArray, FloatArray]:
    """Return poses and places of the root in which the zero moment point lies in the support more often.

    Of a few rounds the one with most balanced frames is taken; the motion as it is counts as one. In the air, and where
    the hips would have to move farther, they move as far as they may.

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
        frame_time: [s].
        within: The hips stay nearer than this to where they were, seen from above [m].
    """
    turn, place = posed_joints(avatar, poses, root)
    masses = part_masses(avatar)
    stiffness = cart_stiffness(turn, place, avatar, masses)
    found = balance(turn, place, avatar, frame_time, masses)
    best, most = (poses, root), found.inside_share
    wanted = np.zeros((len(root), 2))
    for _ in range(_ROUNDS):
        if most is None or most == 1.0:
            break
        wanted = wanted + np.nan_to_num(found.to_support)
        aside = bounded(cart_way(wanted, stiffness, frame_time), within)
        moved = _moved(avatar, turn, place, aside, frame_time)
        found = balance(*posed_joints(avatar, *moved), avatar, frame_time, masses)
        share = found.inside_share
        if share is not None and share > most:
            best, most = moved, share
    return best


def cart_stiffness(turn: FloatArray, place: FloatArray, avatar: Avatar, masses: PartMasses) -> float:
    """Return gravity over the usual height of the centre of mass [1/s²]; arguments as of `balance`."""
    return float(GRAVITY / np.median(part_middles(turn, place, avatar, masses)[..., 1] @ masses.share))


def cart_way(wanted: FloatArray, stiffness: float, frame_time: float) -> FloatArray:
    """Return d of d - d'' / stiffness = wanted, at rest before and after, shape (T, N).

    Args:
        wanted: By how much the zero moment point is to move [m], shape (T, N).
        stiffness: Gravity over the height of the centre of mass [1/s²].
        frame_time: [s].
    """
    near = 1.0 / (stiffness * frame_time**2)
    bands = np.full((2, len(wanted)), -near)
    bands[1] = 1.0 + 2.0 * near
    bands[1, [0, -1]] -= near
    way: FloatArray = solveh_banded(bands, wanted)
    return way


def bounded(way: FloatArray, within: float) -> FloatArray:
    """Return ways that are shorter than this [m], smoothly: short ones stay as they are, shape (T, 2)."""
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(way * within * np.tanh(length / within) / np.maximum(length, 1e-12))


def _moved(
    avatar: Avatar, turn: FloatArray, place: FloatArray, aside: FloatArray, frame_time: float
) -> tuple[FloatArray, FloatArray]:
    """Return poses and places of the root with hips this much aside [m], x and z, and feet as they are."""
    ankles = [avatar.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    held = [Held(turn[:, ankle], place[:, ankle]) for ankle in ankles]
    turn, root = reach_for(turn, place + aside[:, None, [0, 0, 1]] * [1.0, 0.0, 1.0], held, avatar, frame_time)
    return matrix_vectors(local_rotations(avatar.parents.tolist(), turn)), root
