"""Pose and movement: linear blend skinning over the template's skeleton."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.avatar.body_plan import ARM_ANGLE_RAD
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, MovingBody

_ARM_BELOW_HORIZONTAL_RAD = {"a_pose": ARM_ANGLE_RAD, "t_pose": 0.0, "arms_down": np.deg2rad(78.0)}


def pose_avatar(avatar: Avatar, pose: FloatArray, translation: FloatArray) -> Avatar:
    """Return the avatar in another pose.

    Args:
        avatar: Any of our bodies.
        pose: Rotation vector of each joint relative to the bind pose [rad], shape (J, 3), in the parent's frame.
        translation: Of the root [m], shape (3,).

    Linear blend skinning (Magnenat-Thalmann et al. 1988).
    """
    rotation, offset = joint_transforms(avatar.joints, avatar.parents, pose)
    vertices = skin(avatar.bind_vertices, avatar.weights, rotation, offset) + translation
    return replace(avatar, pose=pose, translation=np.asarray(translation, dtype=float), vertices=vertices)


def joint_transforms(joints: FloatArray, parents: np.ndarray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what each joint does to the bind pose, x -> R x + t, shapes (J, 3, 3) and (J, 3). Parents come first."""
    local = Rotation.from_rotvec(np.array(pose, dtype=float)).as_matrix()  # a copy: it refuses read-only arrays
    rotation, offset = np.empty_like(local), np.empty((len(joints), 3))
    for j, parent in enumerate(parents):
        if parent < 0:
            rotation[j], anchor = local[j], joints[j]
        else:
            rotation[j] = rotation[parent] @ local[j]
            anchor = rotation[parent] @ joints[j] + offset[parent]
        offset[j] = anchor - rotation[j] @ joints[j]
    return rotation, offset


def skin(vertices: FloatArray, weights: FloatArray, rotation: FloatArray, offset: FloatArray) -> FloatArray:
    """Return the vertices moved by the blend of their joints, shape (V, 3)."""
    blended = (weights @ rotation.reshape(len(rotation), 9)).reshape(-1, 3, 3)
    return np.einsum("vij,vj->vi", blended, vertices) + weights @ offset


def named_pose(avatar: Avatar, name: str) -> Avatar:
    """Return the avatar in a standard pose, feet on the floor.

    Args:
        avatar: Any of our bodies.
        name: "a_pose" (arms 45 degrees down), "t_pose" (level), "arms_down" (hanging, clear of the hips).

    Raises:
        InputError: an unknown name.
    """
    if name not in _ARM_BELOW_HORIZONTAL_RAD:
        raise InputError(f"pose is {name!r}; wanted one of {', '.join(sorted(_ARM_BELOW_HORIZONTAL_RAD))}")
    turn = ARM_ANGLE_RAD - _ARM_BELOW_HORIZONTAL_RAD[name]
    pose = np.zeros((len(avatar.joint_names), 3))
    # the shoulder girdle carries a fifth of the arm's swing
    for side, sign in (("left", 1.0), ("right", -1.0)):
        pose[avatar.joint_names.index(f"{side}_clavicle"), 2] = sign * 0.2 * turn
        pose[avatar.joint_names.index(f"{side}_shoulder"), 2] = sign * 0.8 * turn
    return pose_avatar(avatar, pose, np.zeros(3))


def morph(source: Avatar, target: Avatar, count: int) -> MovingBody:
    """Return a body that turns from source into target: shape, skeleton and place in straight lines, joints by slerp.

    Args:
        source: Start.
        target: End, of the same topology.
        count: Keyframes, at least 2; the first is the source, the last the target.

    Raises:
        InputError: fewer than two keyframes, or different topologies.
    """
    if count < 2:
        raise InputError(f"{count} keyframe(s); a morph needs at least 2")
    if not np.array_equal(source.faces, target.faces) or source.joint_names != target.joint_names:
        raise InputError("the two avatars do not share one topology", hint="register the source body first")
    turns = [
        Slerp([0.0, 1.0], Rotation.from_rotvec(np.stack([a, b]))) for a, b in zip(source.pose, target.pose, strict=True)
    ]
    frames = []
    for t in np.linspace(0.0, 1.0, count):
        blend = replace(
            source,
            bind_vertices=(1 - t) * source.bind_vertices + t * target.bind_vertices,
            joints=(1 - t) * source.joints + t * target.joints,
        )
        pose = np.stack([turn(t).as_rotvec() for turn in turns])
        moved = pose_avatar(blend, pose, (1 - t) * source.translation + t * target.translation)
        frames.append(moved.vertices)
    frames[0], frames[-1] = source.vertices, target.vertices
    return MovingBody(np.array(frames), source.faces)
