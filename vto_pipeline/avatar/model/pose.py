"""Poses of a body, named ones, and the movement from one to another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from vto_pipeline.avatar.model.skinning import skin_transforms
from vto_pipeline.avatar.template.body_plan import ARM_ANGLE_RAD
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, MovingBody

_ARM_BELOW_HORIZONTAL_RAD = {
    "a_pose": ARM_ANGLE_RAD,
    "t_pose": 0.0,
    "arms_down": np.deg2rad(78.0),
    "arms_up": np.deg2rad(-60.0),
    "sitting": ARM_ANGLE_RAD,
    "step": ARM_ANGLE_RAD,
}
_FORWARD_RAD = {  # thighs, then how far the knees bend back: left, right
    "sitting": (np.deg2rad([90.0, 90.0]), np.deg2rad([90.0, 90.0])),
    "step": (np.deg2rad([25.0, -20.0]), np.deg2rad([5.0, 15.0])),
}

_RAISED_RAD = np.deg2rad([0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])


def pose_avatar(avatar: Avatar, pose: FloatArray, translation: FloatArray) -> Avatar:
    """Return the avatar in another pose.

    Args:
        avatar: Any of our bodies.
        pose: Rotation vector of each joint relative to the bind pose [rad], shape (J, 3), in the parent's frame.
        translation: Of the root [m], shape (3,).

    """
    vertices = posed_vertices(avatar, pose, translation)
    return replace(avatar, pose=pose, translation=np.asarray(translation, dtype=float), vertices=vertices)


def posed_vertices(avatar: Avatar, pose: FloatArray, translation: FloatArray) -> FloatArray:
    """Return where the avatar's vertices are in another pose [m], shape (V, 3); as `pose_avatar`."""
    turn, place = skin_transforms(avatar.weights, avatar.joint_names, avatar.joints, avatar.parents, pose)
    return np.einsum("vij,vj->vi", turn, avatar.bind_vertices) + place + translation


def parent_rotations(rotation: FloatArray, parents: np.ndarray) -> FloatArray:
    """Return the rotation of each joint's parent, shape (J, 3, 3); the identity for the root."""
    return np.stack([np.eye(3) if parent < 0 else rotation[parent] for parent in parents])


def compose_pose(pose: FloatArray, turn: FloatArray, above: FloatArray) -> FloatArray:
    """Return a pose whose joints are turned further, shape (J, 3).

    Args:
        pose: Rotation vectors in the parents' frames, shape (J, 3).
        turn: Rotation vectors in world axes, shape (J, 3).
        above: Rotations of the parents, shape (J, 3, 3).
    """
    turned = np.empty_like(pose)
    for j, parent in enumerate(above):
        local = parent.T @ Rotation.from_rotvec(turn[j]).as_matrix() @ parent
        turned[j] = (Rotation.from_matrix(local) * Rotation.from_rotvec(pose[j])).as_rotvec()
    return turned


def named_pose(avatar: Avatar, name: str, raised: float = 0.0) -> Avatar:
    """Return the avatar in a standard pose, feet on the floor.

    Args:
        avatar: Any of our bodies.
        name: "a_pose" (arms 45 degrees down), "t_pose" (level), "arms_down" (hanging), "arms_up" (60 degrees above
            level), "sitting" (thighs level, shins upright), "step" (left foot forward); arms as in the A-pose in both.
        raised: How much higher the arms are held [rad].

    Raises:
        InputError: an unknown name.
    """
    if name not in _ARM_BELOW_HORIZONTAL_RAD:
        raise InputError(f"pose is {name!r}; expected one of {', '.join(sorted(_ARM_BELOW_HORIZONTAL_RAD))}")
    turn = ARM_ANGLE_RAD - _ARM_BELOW_HORIZONTAL_RAD[name] + raised
    pose = np.zeros((len(avatar.joint_names), 3))
    # the shoulder girdle carries a fifth of the arm's swing
    for side, sign in (("left", 1.0), ("right", -1.0)):
        pose[avatar.joint_names.index(f"{side}_clavicle"), 2] = sign * 0.2 * turn
        pose[avatar.joint_names.index(f"{side}_shoulder"), 2] = sign * 0.8 * turn
    for side, thigh, knee in zip(("left", "right"), *_FORWARD_RAD.get(name, ((), ())), strict=False):
        pose[avatar.joint_names.index(f"{side}_hip"), 0] = -thigh
        pose[avatar.joint_names.index(f"{side}_knee"), 0] = knee
    posed = pose_avatar(avatar, pose, np.zeros(3))
    return pose_avatar(avatar, pose, np.array([0.0, -posed.vertices[:, 1].min(), 0.0]))


def clear_pose(avatar: Avatar, name: str) -> Avatar:
    """Return a named pose with the arms raised until they pass through nothing: what cloth can be draped on.

    Folds at the groin of a sitting body may remain.

    Args:
        avatar: Any of our bodies.
        name: As for `named_pose`.
    """
    best, fewest = named_pose(avatar, name), -1
    for raised in _RAISED_RAD:
        posed = named_pose(avatar, name, raised)
        crossing = len(self_intersections(posed.mesh))
        if fewest < 0 or crossing < fewest:
            best, fewest = posed, crossing
        if crossing == 0:
            break
    return best


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
