"""Where an avatar's feet touch the floor: heel and ball of each foot."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import CONTACTS

_BALL = 0.72
"""From heel to toe, where the ball of the foot stands."""

_SOLE_M = 0.01
"""What lies lower than this above the lowest point belongs to the sole."""


def contact_points(avatar: Avatar) -> FloatArray:
    """Return heels and balls from their ankles, in the bind pose, in the order of `CONTACTS` [m], shape (4, 3)."""
    points = []
    for contact in CONTACTS:
        side, _, part = contact.partition("_")
        heel, toe = (avatar.bind_vertices[avatar.landmarks[f"{side}_{name}"]] for name in ("heel", "toe"))
        ankle = avatar.joints[avatar.joint_names.index(f"{side}_ankle")]
        point = heel + (_BALL * (toe - heel) if part == "ball" else 0.0)
        points.append([point[0], _foot(avatar, side)[:, 1].min(), point[2]] - ankle)
    return np.array(points)


def sole_points(avatar: Avatar, side: str) -> FloatArray:
    """Return the points of a sole from the ankle, in the bind pose [m], shape (N, 3)."""
    foot = _foot(avatar, side)
    sole: FloatArray = foot[foot[:, 1] < foot[:, 1].min() + _SOLE_M]
    return sole - avatar.joints[avatar.joint_names.index(f"{side}_ankle")]


def _foot(avatar: Avatar, side: str) -> FloatArray:
    held = avatar.weights[:, avatar.joint_names.index(f"{side}_ankle")] > 0.5
    foot: FloatArray = avatar.bind_vertices[held]
    return foot


def contact_places(turn: FloatArray, place: FloatArray, avatar: Avatar) -> FloatArray:
    """Return the world places of heels and balls [m], shape (T, 4, 3).

    Args:
        turn: World rotations of the joints relative to the bind pose, shape (T, J, 3, 3).
        place: World places of the joints [m], shape (T, J, 3).
        avatar: Whose.
    """
    ankles = [avatar.joint_names.index(f"{contact.partition('_')[0]}_ankle") for contact in CONTACTS]
    found: FloatArray = place[:, ankles] + np.einsum("tcab,cb->tca", turn[:, ankles], contact_points(avatar))
    return found
