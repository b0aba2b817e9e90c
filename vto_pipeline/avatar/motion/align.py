"""Turns and places of a foreign skeleton, carried over to an avatar.

Each joint turns from its rest as the source's joint does, after both rest poses are laid on each other: the body's axes
as a whole, then the direction of each bone of arms and legs by the smallest rotation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

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


class Fit(NamedTuple):
    """What is measured of a skeleton once, so that any frame of it can be carried over.

    Args:
        resting, at_rest: World rotation and place of each of its joints as it stands, shapes (J, 3, 3) and (J, 3).
        scale: The avatar's legs over its own.
        origin: What becomes the point of the floor below the avatar's hips [m], shape (3,).
        tilts: Side -> how a foot is turned in its own frame to be level, shape (3, 3).
    """

    resting: FloatArray
    at_rest: FloatArray
    scale: float
    origin: FloatArray
    tilts: Mapping[str, FloatArray]


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
    return carried(clip, joints, avatar, fit_of(clip, joints, avatar, job))


def fit_of(clip: Clip, joints: JointMap, avatar: Avatar, job: Job) -> Fit:
    """Return what carries the frames of a clip over to an avatar; see `carry_over`.

    Feet are turned so that they are level, on average, while they stand still. Skeletons at rest hold them in different
    ways, some across the shank, some level: the floor is the same.
    """
    turn, place = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    resting, at_rest = _standing(clip, joints, turn, place, job)
    indices, bind = joints.indices, _bind(avatar)
    ankles = {side: indices[f"{side}_ankle"] for side in ("left", "right")}
    still = {side: _still(side, joints, place, clip.frame_time) for side in ankles}
    found = _turned(turn, resting, at_rest, joints, avatar)
    tilts = {side: _tilt(side, found[f"{side}_ankle"][frames], job) for side, frames in still.items()}
    stands = np.concatenate([place[still[side], ankle, 1] for side, ankle in ankles.items()])
    lowest = place[:, list(ankles.values()), 1].min(axis=1)
    floor = np.median(stands) if len(stands) else np.percentile(lowest, _LOW_SHARE)
    middle = _hips(place[0], joints)
    scale = _leg(bind) / leg_length(clip, joints)
    return Fit(resting, at_rest, scale, np.array([middle[0], floor, middle[2]]), tilts)


def carried(clip: Clip, joints: JointMap, avatar: Avatar, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Return what `carry_over` does, of frames of a skeleton that is measured already.

    Args:
        clip: Any frames of it; in metres, +Y up.
        joints: Of the clip.
        avatar: That the fit was made for.
        fit: Of the skeleton.
    """
    turn, place = world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)
    found, bind = _turned(turn, fit.resting, fit.at_rest, joints, avatar), _bind(avatar)
    for side, tilt in fit.tilts.items():
        found[f"{side}_ankle"] = found[f"{side}_ankle"] @ tilt
    middle = fit.scale * (_hips(place, joints) - fit.origin)
    middle[:, 1] += min(bind[f"{side}_ankle"][1] for side in ("left", "right")) - avatar.bind_vertices[:, 1].min()
    inside = (bind["left_hip"] + bind["right_hip"]) / 2 - bind["pelvis"]
    return np.stack([found[name] for name in avatar.joint_names], axis=1), middle - found["pelvis"] @ inside


def _turned(
    turn: FloatArray, resting: FloatArray, at_rest: FloatArray, joints: JointMap, avatar: Avatar
) -> dict[str, FloatArray]:
    """Return each joint's world rotation relative to the bind pose, feet as the skeleton holds them, (T, 3, 3) each."""
    axes = _body_axes(joints, at_rest)
    indices, bind = joints.indices, _bind(avatar)
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
    return found


def _bind(avatar: Avatar) -> dict[str, FloatArray]:
    """Return the avatar's joint -> its place in the bind pose [m]."""
    return dict(zip(avatar.joint_names, avatar.joints, strict=True))


def _hips(place: FloatArray, joints: JointMap) -> FloatArray:
    """Return the middle of both hips, shape (..., 3)."""
    hips = [joints.indices["left_hip"], joints.indices["right_hip"]]
    middle: FloatArray = place[..., hips, :].mean(axis=-2)
    return middle


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


def _tilt(side: str, standing: FloatArray, job: Job) -> FloatArray:
    """Return the turn of a foot in its own frame that levels it, on average, over the frames in which it stands."""
    up = (np.swapaxes(standing, -1, -2) @ _UP).mean(axis=0) if len(standing) else _UP
    tilt = shortest_rotations(_UP, up)
    angle = float(np.linalg.norm(matrix_vectors(tilt)))
    if angle > _MOST_TILT_RAD:
        job.warn(f"the {side} foot stands at {np.rad2deg(angle):.0f} degrees to the floor; it is left so")
        return np.eye(3)
    return np.asarray(tilt)
