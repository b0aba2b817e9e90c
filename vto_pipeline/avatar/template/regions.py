"""Vertices of each part of the body; the fixed topology makes them valid for every avatar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.template.template import membership
from vto_pipeline.model.body import Avatar

_HALF = 0.5
_MOVES = {
    "pelvis": "seat and hips",
    "spine": "waist",
    "chest": "chest and back",
    "neck": "neck",
    "head": "head",
    "clavicle": "shoulder",
    "shoulder": "upper arm",
    "elbow": "forearm",
    "wrist": "hand",
    "hip": "thigh",
    "knee": "lower leg",
    "ankle": "foot",
}
"""Joint -> the part of the body that it moves, in words."""


def trunk_vertices(avatar: Avatar) -> NDArray[np.bool_]:
    """Return which vertices are neither arm nor leg: trunk, neck and head, shape (V,)."""
    return (membership("arm") < _HALF) & ~leg_vertices(avatar)


def leg_vertices(avatar: Avatar) -> NDArray[np.bool_]:
    """Return which vertices are leg: moved by a hip or what hangs on it more than by the pelvis, shape (V,)."""
    joints = [k for k, name in enumerate(avatar.joint_names) if name.endswith(("hip", "knee", "ankle"))]
    # the crotch is half left and half right leg, and still trunk
    return (avatar.weights[:, joints].sum(axis=1) > _HALF) & (
        avatar.vertices[:, 1] < avatar.vertices[avatar.landmarks["crotch_point"], 1]
    )


def part_names(avatar: Avatar) -> NDArray[np.str_]:
    """Return the name, in words, of the part of the body that each vertex belongs to, shape (V,)."""
    names = np.array([_in_words(joint) for joint in avatar.joint_names])
    return names[avatar.weights.argmax(axis=1)]


def _in_words(joint: str) -> str:
    """Return what a joint moves: "left_hip" the left thigh."""
    side, _, own = joint.rpartition("_")
    return f"{side} {_MOVES[own]}".strip()
