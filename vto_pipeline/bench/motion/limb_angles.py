"""How far an avatar's limbs point from where the source's do."""

from __future__ import annotations

import numpy as np

from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.io.motion.read import MotionFile
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion
from vto_pipeline.numerics.kinematics import quaternion_matrices, world_transforms

BONES = {
    "upper arms": ("shoulder", "elbow"),
    "forearms": ("elbow", "wrist"),
    "thighs": ("hip", "knee"),
    "shanks": ("knee", "ankle"),
}


def limb_angles(read: MotionFile, avatar: Avatar, motion: AvatarMotion) -> dict[str, FloatArray]:
    """Return for each pair of limbs the angles between source and avatar in all frames [rad], shape (2 T,).

    Limbs that the source lacks are left out.

    Args:
        read: The source.
        avatar: Whose motion it became.
        motion: Frame by frame as the source's.
    """
    clip, indices, names = read.clip, read.joints.indices, avatar.joint_names
    _, theirs = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    _, ours = posed_joints(avatar, motion.poses, avatar.joints[0] + motion.translations)
    found: dict[str, list[FloatArray]] = {}
    for limb, joints in BONES.items():
        for side in ("left", "right"):
            start, end = (f"{side}_{joint}" for joint in joints)
            if start in indices and end in indices:
                way = theirs[:, indices[end]] - theirs[:, indices[start]]
                own = ours[:, names.index(end)] - ours[:, names.index(start)]
                found.setdefault(limb, []).append(_angles(way, own))
    return {limb: np.concatenate(sides) for limb, sides in found.items()}


def _angles(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return angles between directions [rad], shape (T,); exact for small ones, where an arc cosine is not."""
    across = np.linalg.norm(np.cross(one, other), axis=1)
    angles: FloatArray = np.arctan2(across, (one * other).sum(axis=1))
    return angles
