"""Unit and up axis of a clip whose file says neither."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vto_pipeline.io.motion.joint_map import JointMap
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.motion import Clip
from vto_pipeline.numerics.kinematics import matrix_quaternions, quaternion_matrices, world_transforms
from vto_pipeline.units import LENGTH_M

_UNITS = {**{name: LENGTH_M[name] for name in ("m", "dm", "cm", "mm", "in")}, "CMU's": 0.0254 / 0.45}
"""CMU's skeletons (ASF) say length 0.45: their numbers are inches divided by it."""

_LEGS_M = (0.62, 1.0)
"""Hip to ankle along the bones of grown people: ANSUR II's crotch heights, with a margin."""

_USUAL_LEG_M = 0.8
_CLEAR = 0.8
"""Cosine of the angle to an axis up to which a body stands along it; the frames decide, else the rest pose."""

_SAMPLES = 64


@dataclass(frozen=True)
class Axes:
    """What was found.

    Args:
        unit: Its name, or "unknown": the clip is then scaled to ordinary legs.
        metres: Metres per unit.
        up: Axis that points up in the file, such as "+Z".
    """

    unit: str
    metres: float
    up: str


def upright(clip: Clip, joints: JointMap, unit: str | None, up: str | None) -> tuple[Clip, Axes]:
    """Return a clip in metres with +Y up.

    Args:
        clip: In the unit and axes of its file.
        joints: Of it.
        unit: Unit of length, a key of `units.LENGTH_M`; None: the one in which legs have a usual length.
        up: Axis that points up; None: the one along which the body stands in most frames, else at rest.
    """
    legs = leg_length(clip, joints)
    if unit is not None:
        name, metres = unit, LENGTH_M[unit]
    else:
        low, high = _LEGS_M
        name = next((one for one, size in _UNITS.items() if low <= legs * size <= high), "unknown")
        metres = _UNITS.get(name, _USUAL_LEG_M / max(legs, 1e-12))
    axis = up or _up_axis(clip, joints)
    turn = to_y(axis)
    roots = clip.parents < 0
    rotations, translations = clip.rotations.copy(), clip.translations * metres
    rotations[:, roots] = matrix_quaternions(turn @ quaternion_matrices(clip.rotations[:, roots]))
    translations[:, roots] = translations[:, roots] @ turn.T
    return (
        replace(clip, offsets=clip.offsets * metres, rotations=rotations, translations=translations),
        Axes(name, metres, axis),
    )


def rest_places(clip: Clip) -> tuple[FloatArray, FloatArray]:
    """Return world rotation and place of each joint at rest, shapes (J, 3, 3) and (J, 3)."""
    turn, place = world_transforms(clip.parents, quaternion_matrices(clip.rest)[None], clip.offsets)
    return turn[0], place[0]


def leg_length(clip: Clip, joints: JointMap) -> float:
    """Return the mean length of the legs from hip to ankle along the bones, in the clip's unit."""
    _, place = rest_places(clip)
    total = 0.0
    for side in ("left", "right"):
        hip, knee, ankle = (place[joints.indices[f"{side}_{joint}"]] for joint in ("hip", "knee", "ankle"))
        total += float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
    return total / 2


def body_direction(joints: JointMap, places: FloatArray) -> FloatArray:
    """Return the direction from the ankles to the head, or what is highest of the trunk, of any length, (..., 3)."""
    top = next(joints.indices[name] for name in ("head", "neck", "chest", "pelvis") if name in joints.indices)
    ankles = [joints.indices["left_ankle"], joints.indices["right_ankle"]]
    direction: FloatArray = places[..., top, :] - places[..., ankles, :].mean(axis=-2)
    return direction


def _up_axis(clip: Clip, joints: JointMap) -> str:
    some = np.unique(np.linspace(0, len(clip.rotations) - 1, _SAMPLES).astype(int))
    _, posed = world_transforms(clip.parents, quaternion_matrices(clip.rotations[some]), clip.translations[some])
    _, rest = rest_places(clip)
    for direction in (body_direction(joints, posed).mean(axis=0), body_direction(joints, rest)):
        k = int(np.argmax(abs(direction)))
        if abs(direction[k]) >= _CLEAR * np.linalg.norm(direction) > 0:
            return f"{'+' if direction[k] > 0 else '-'}{'XYZ'[k]}"
    return "+Y"


def to_y(axis: str) -> FloatArray:
    """Return the rotation that brings a signed axis to +Y by a quarter turn, or half a turn, about another axis."""
    start = np.zeros(3)
    start["XYZ".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    end = np.array([0.0, 1.0, 0.0])
    if axis[1] == "Y":
        return np.diag([1.0, 1.0, 1.0]) if axis[0] == "+" else np.diag([1.0, -1.0, -1.0])
    across = np.cross(start, end)
    return np.outer(end, start) - np.outer(start, end) + np.outer(across, across)
