"""Turns and places of a foreign skeleton, carried over to an avatar.

Each joint turns from its rest as the source's joint does, after both rest poses are laid on each other: the body's axes
as a whole, then the direction of each bone of arms and legs by the smallest rotation.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import InputError
from vto_pipeline.io.motion.joint_map import JointMap, rest_left
from vto_pipeline.io.motion.upright import body_direction, leg_length, rest_places
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import Clip
from vto_pipeline.numerics.kinematics import (
    matrix_vectors,
    quaternion_matrices,
    shortest_rotations,
    vector_matrices,
    world_transforms,
)

_UP = np.array([0.0, 1.0, 0.0])
_BONES = {"shoulder": "elbow", "elbow": "wrist", "hip": "knee", "knee": "ankle"}
_CLEAR = 0.8  # cosine up to which a body stands along an axis
_STANDS = 0.7  # cosine of a leg's angle to the vertical, at rest
_STILL_M_S, _STILL_S = 0.15, 0.1
_LOW_SHARE = 5.0  # per cent of the frames in which an ankle is lowest
_MOST_TILT_RAD = np.deg2rad(35.0)


def carry_over(clip: Clip, joints: JointMap, avatar: Avatar, job: Job) -> tuple[FloatArray, FloatArray]:
    """Return world rotations of the avatar's joints relative to its bind pose, and places of its root.

    The root moves by the ratio of leg lengths, starts over the origin, and its height puts the lowest ankles where the
    avatar's stand.

    Args:
        clip: In metres, +Y up.
        joints: Of the clip.
        avatar: Any of our bodies.
        job: Notified of what is missing.

    Returns:
        Shapes (T, J, 3, 3) and (T, 3) [m].

    Raises:
        InputError: the source stands neither at rest nor in the first frame.
    """
    turn, place = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    resting, at_rest = _standing(clip, joints, turn, place, job)
    axes = _body_axes(joints, at_rest)
    indices = joints.indices
    bind = dict(zip(avatar.joint_names, avatar.joints, strict=True))
    delta = {name: turn[:, k] @ resting[k].T for name, k in indices.items()}
    found: dict[str, FloatArray] = {name: delta[name] @ axes for name in indices if name in bind}
    for side in ("left", "right"):
        laid = axes
        for joint, end in _BONES.items():
            name, tip = f"{side}_{joint}", f"{side}_{end}"
            if name in indices and tip in indices:
                bone = at_rest[indices[tip]] - at_rest[indices[name]]
                if np.linalg.norm(bone) > 0:
                    laid = shortest_rotations(axes @ (bind[tip] - bind[name]), bone) @ axes
                found[name] = delta[name] @ laid
            if end in ("wrist", "ankle") and tip in indices:  # hand and foot go with the bone above
                found[tip] = delta[tip] @ laid
        _aim_foot(side, found, delta, joints, at_rest, avatar)
    _fill(found, len(turn))
    scale = _leg(bind) / leg_length(clip, joints)
    still = {side: _still(side, joints, place, clip.frame_time) for side in ("left", "right")}
    _level_feet(found, still, job)
    hips = [indices["left_hip"], indices["right_hip"]]
    ankles = [indices["left_ankle"], indices["right_ankle"]]
    middle = place[:, hips].mean(axis=1)
    stands = np.concatenate([place[still[side], k, 1] for side, k in zip(("left", "right"), ankles, strict=True)])
    floor = np.median(stands) if len(stands) else np.percentile(place[:, ankles, 1].min(axis=1), _LOW_SHARE)
    middle = scale * (middle - [middle[0, 0], floor, middle[0, 2]])
    middle[:, 1] += min(bind[f"{side}_ankle"][1] for side in ("left", "right")) - avatar.bind_vertices[:, 1].min()
    inside = (bind["left_hip"] + bind["right_hip"]) / 2 - bind["pelvis"]
    return np.stack([found[name] for name in avatar.joint_names], axis=1), middle - found["pelvis"] @ inside


def _standing(
    clip: Clip, joints: JointMap, turn: FloatArray, place: FloatArray, job: Job
) -> tuple[FloatArray, FloatArray]:
    """Rotations and places of a pose that stands: at rest, else in the first frame."""
    resting, at_rest = rest_places(clip)
    if _stands(joints, at_rest):
        return resting, at_rest
    if _stands(joints, place[0]):
        job.note("the skeleton does not stand at rest; its first frame is taken for the rest pose")
        return turn[0], place[0]
    raise InputError(
        "the skeleton stands neither at rest nor in the first frame", hint="put a T-pose or an A-pose first"
    )


def _stands(joints: JointMap, places: FloatArray) -> bool:
    up = body_direction(joints, places)
    length = np.linalg.norm(up)
    if length == 0.0 or np.linalg.norm(rest_left(joints, places)) == 0.0:
        return False
    for side in ("left", "right"):
        leg = places[joints.indices[f"{side}_hip"]] - places[joints.indices[f"{side}_ankle"]]
        if leg @ up < _STANDS * np.linalg.norm(leg) * length:
            return False
    return True


def _body_axes(joints: JointMap, places: FloatArray) -> FloatArray:
    """The rotation that takes our left, up and front to the source's at rest, shape (3, 3)."""
    up = body_direction(joints, places)
    up = up / np.linalg.norm(up)
    k = int(np.argmax(abs(up)))
    if abs(up[k]) >= _CLEAR:  # a head held forward is no lean
        up = np.eye(3)[k] * np.sign(up[k])
    left = rest_left(joints, places)
    left = left - (left @ up) * up
    left = left / np.linalg.norm(left)
    return np.column_stack([left, up, np.cross(left, up)])


def _leg(bind: Mapping[str, FloatArray]) -> float:
    """Mean length of the avatar's legs."""
    lengths = [
        np.linalg.norm(bind[f"{side}_{a}"] - bind[f"{side}_{b}"])
        for side in ("left", "right")
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    ]
    return float(sum(lengths)) / 2


def _aim_foot(
    side: str,
    found: dict[str, FloatArray],
    delta: Mapping[str, FloatArray],
    joints: JointMap,
    at_rest: FloatArray,
    avatar: Avatar,
) -> None:
    """Turn the foot about the shank until it points where the source's does at rest."""
    ankle, toe = f"{side}_ankle", f"{side}_toe"
    if toe not in joints.indices:
        return
    own = avatar.bind_vertices[avatar.landmarks[toe]] - avatar.bind_vertices[avatar.landmarks[f"{side}_heel"]]
    laid = delta[ankle][0].T @ found[ankle][0]
    shank = at_rest[joints.indices[f"{side}_knee"]] - at_rest[joints.indices[ankle]]
    foot = at_rest[joints.indices[toe]] - at_rest[joints.indices[ankle]]
    shank = shank / np.linalg.norm(shank)
    ahead, there = (v - (v @ shank) * shank for v in (laid @ own, foot))
    if min(np.linalg.norm(ahead), np.linalg.norm(there)) > 1e-6:
        found[ankle] = delta[ankle] @ shortest_rotations(ahead, there) @ laid


def _fill(found: dict[str, FloatArray], frames: int) -> None:
    """Give joints that the source lacks the turn of a neighbour, or the middle of two."""
    found.setdefault("chest", found["pelvis"])
    found.setdefault("spine", _halfway(found["pelvis"], found["chest"]))
    found.setdefault("head", found.get("neck", found["chest"]))
    found.setdefault("neck", _halfway(found["chest"], found["head"]))
    for side in ("left", "right"):
        for name, above in (("clavicle", "chest"), ("shoulder", None), ("elbow", None), ("wrist", None)):
            order = ("clavicle", "shoulder", "elbow", "wrist")
            holder = above or f"{side}_{order[order.index(name) - 1]}"
            found.setdefault(f"{side}_{name}", found[holder])


def _halfway(first: FloatArray, second: FloatArray) -> FloatArray:
    """Rotations in the middle of two, shape (T, 3, 3)."""
    between = matrix_vectors(np.swapaxes(first, -1, -2) @ second)
    return first @ vector_matrices(between / 2)


def _still(side: str, joints: JointMap, place: FloatArray, frame_time: float) -> NDArray[np.bool_]:
    """In which frames a foot of the source stands still: ankle and toe are slow, and the ankle low, shape (T,)."""
    reach = max(1, round(_STILL_S / 2 / frame_time))
    frames = np.arange(len(place))
    ahead, behind = np.minimum(frames + reach, len(place) - 1), np.maximum(frames - reach, 0)
    seconds = np.maximum(ahead - behind, 1) * frame_time
    ankle = joints.indices[f"{side}_ankle"]
    points = [ankle, joints.indices.get(f"{side}_toe", ankle)]
    moved = np.linalg.norm(place[ahead][:, points] - place[behind][:, points], axis=-1).max(axis=1)
    low = place[:, ankle, 1] <= np.median(place[:, ankle, 1])
    still: NDArray[np.bool_] = (moved < _STILL_M_S * seconds) & low
    return still


def _level_feet(found: dict[str, FloatArray], still: Mapping[str, NDArray[np.bool_]], job: Job) -> None:
    """Turn each foot in its own frame so that it is level, on average, while it stands still.

    Skeletons at rest hold their feet in different ways, some across the shank, some level: the floor is the same.
    """
    for side, frames in still.items():
        if not frames.any():
            continue
        up = (np.swapaxes(found[f"{side}_ankle"][frames], -1, -2) @ _UP).mean(axis=0)
        tilt = shortest_rotations(_UP, up)
        angle = float(np.linalg.norm(matrix_vectors(tilt)))
        if angle > _MOST_TILT_RAD:
            job.warn(f"the {side} foot stands at {np.rad2deg(angle):.0f} degrees to the floor; it is left so")
            continue
        found[f"{side}_ankle"] = found[f"{side}_ankle"] @ tilt
