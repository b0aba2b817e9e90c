"""The template body: fixed topology, female to male, standing in the A-pose on y = 0 and facing +Z."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.avatar.template.body_plan import FEMALE, MALE
from vto_pipeline.avatar.template.implicit import arm_axis, smoothstep
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import Avatar

JOINTS = (
    "pelvis",
    "spine",
    "chest",
    "neck",
    "head",
    *(
        f"{side}_{joint}"
        for side in ("left", "right")
        for joint in ("clavicle", "shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    ),
)
JOINT_KINDS = tuple(name.rpartition("_")[2] for name in JOINTS)
"""Each joint's name without its side."""
ARM, LEG = ("shoulder", "elbow", "wrist"), ("hip", "knee", "ankle")
_PARENT = {
    "spine": "pelvis",
    "chest": "spine",
    "neck": "chest",
    "head": "neck",
    "clavicle": "chest",
    "shoulder": "clavicle",
    "elbow": "shoulder",
    "wrist": "elbow",
    "hip": "pelvis",
    "knee": "hip",
    "ankle": "knee",
}
_BEND_M = {
    "spine": 0.07,
    "chest": 0.07,
    "neck": 0.03,
    "head": 0.035,
    "elbow": 0.07,
    "wrist": 0.025,
    "knee": 0.09,
    "ankle": 0.03,
}
"""Half the length over which a joint's bend is spread."""
_LIMB_ROWS = ("armscye", "upper_arm", "elbow", "forearm", "wrist", "thigh", "knee", "calf", "ankle")
_TRUNK_ROWS = ("hip", "high_hip", "navel", "waist", "underbust", "chest", "axilla", "neck_base", "neck", "head")


def template(sex: float = 0.5) -> Avatar:
    """Return the mean body of a sex, in the bind pose.

    Args:
        sex: 0 female ... 1 male; anything between is a blend.

    Raises:
        InputError: sex outside 0..1.
    """
    if not 0 <= sex <= 1:
        raise InputError(f"sex is {sex}; expected 0 (female) to 1 (male)")
    data = _data()
    half = (1 - sex) * data["female"] + sex * data["male"]
    vertices = _whole(half.astype(np.float64), np.array([-1.0, 1.0, 1.0]))
    joints = _joints(sex)
    names = JOINTS
    return Avatar(
        bind_vertices=vertices,
        faces=data["faces"],
        joint_names=names,
        joints=joints,
        parents=np.array(
            [names.index(parent_name(name)) if name != "pelvis" else -1 for name in names], dtype=np.int32
        ),
        weights=_weights(),
        pose=np.zeros((len(names), 3)),
        translation=np.zeros(3),
        vertices=vertices,
        sex=float(sex),
        landmarks=_landmarks(),
        loops=_loops(),
        parameters={},
    )


def parent_name(name: str) -> str:
    """Return the name of a joint's parent."""
    side, _, joint = name.rpartition("_")
    parent = _PARENT[joint]
    return f"{side}_{parent}" if side and parent not in ("chest", "pelvis") else parent


def membership(limb: str) -> FloatArray:
    """Return how much each vertex belongs to the arms or the legs ("arm", "clavicle", "leg"), 0 to 1, shape (V,)."""
    return _whole(_data()[limb].astype(np.float64), np.array(1.0))


@cache
def beyond_armscye() -> NDArray[np.bool_]:
    """Return which vertices lie on the arms' side of the armscyes, shape (V,): where a tape round the chest stops."""
    data = _data()
    arm = np.zeros(len(data["mirror"]))
    arm[data["row_arm"]] = 1.0
    return _whole(arm, np.array(1.0)) > 0


@cache
def _data() -> dict[str, NDArray[Any]]:
    with np.load(Path(__file__).with_name("template.npz"), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _whole(half: FloatArray, reflection: FloatArray) -> FloatArray:
    return np.concatenate([half, half[~_data()["mirror"]] * reflection])


def _joints(sex: float) -> FloatArray:
    both = []
    for plan in (FEMALE, MALE):
        joints = {name: np.array(place) for name, place in plan.joints.items()}
        for name, along in (("shoulder", 0.0), ("elbow", plan.elbow), ("wrist", plan.wrist)):
            joints[f"left_{name}"] = plan.shoulder + along * arm_axis()
        joints |= {
            name.replace("left", "right"): place * [-1, 1, 1]
            for name, place in joints.items()
            if name.startswith("left")
        }
        both.append(np.array([joints[name] for name in JOINTS]))
    return (1 - sex) * both[0] + sex * both[1]


@cache
def _weights() -> FloatArray:
    """Skinning weights of the blend of both sexes: what lies beyond a joint, less what lies beyond its children."""
    data = _data()
    half = (data["female"].astype(np.float64) + data["male"]) / 2
    vertices = _whole(half, np.array([-1.0, 1.0, 1.0]))
    joints = dict(zip(JOINTS, _joints(0.5), strict=True))
    arm, clavicle, leg = membership("arm"), membership("clavicle"), membership("leg")
    # an arm hangs beside the trunk: for the spine's joints it counts as being as high as its shoulder
    height = vertices[:, 1] + clavicle * (joints["left_shoulder"][1] - vertices[:, 1])
    beyond = {"pelvis": np.ones(len(vertices))}
    for name in JOINTS[1:]:
        side, _, joint = name.rpartition("_")
        on_side = np.where(vertices[:, 0] == 0, 0.5, (vertices[:, 0] > 0) == (side == "left"))
        if joint in ("clavicle", "shoulder", "hip"):
            share = {"clavicle": clavicle, "shoulder": arm, "hip": leg}[joint] * on_side
        elif joint in ("elbow", "wrist"):
            along = (vertices * [1 if side == "left" else -1, 1, 1] - joints["left_shoulder"]) @ arm_axis()
            share = _step(
                along
                - (joints[name] - joints[f"{side}_shoulder"]) @ (arm_axis() * [1 if side == "left" else -1, 1, 1]),
                _BEND_M[joint],
            )
        elif joint in ("knee", "ankle"):
            share = _step(joints[name][1] - vertices[:, 1], _BEND_M[joint])
        else:
            share = _step(height - joints[name][1], _BEND_M[joint])
        beyond[name] = beyond[parent_name(name)] * share
    weights = np.stack([beyond[name] for name in JOINTS], axis=1)
    for child, name in enumerate(JOINTS[1:], start=1):
        weights[:, JOINTS.index(parent_name(name))] -= beyond[JOINTS[child]]
    weights = np.maximum(weights, 0.0)
    return weights / weights.sum(axis=1, keepdims=True)


def _step(distance: FloatArray, half_width: float) -> FloatArray:
    return smoothstep(np.clip(distance / (2 * half_width) + 0.5, 0.0, 1.0))


@cache
def _loops() -> dict[str, IntArray]:
    data = _data()
    twin = mirror_indices(data["mirror"])
    loops = {}
    for name in _TRUNK_ROWS:
        row = data[f"row_{name}"]
        loops[name] = np.concatenate([row, twin[row[1:-1]][::-1]])
    for name in _LIMB_ROWS:
        row = data[f"row_{name}"]
        loops[f"left_{name}"], loops[f"right_{name}"] = row, twin[row]
    return loops


@cache
def columns() -> dict[str, IntArray]:
    """Return the chains of vertices that run along the body, lowest first: front, back, and over each shoulder."""
    data = _data()
    shoulder = data["row_shoulder_column"]
    return {
        "front_column": data["row_front_column"],
        "back_column": data["row_back_column"],
        "left_shoulder_column": shoulder,
        "right_shoulder_column": mirror_indices(data["mirror"])[shoulder],
    }


@cache
def _landmarks() -> dict[str, int]:
    """Name -> vertex, chosen on the blend of both sexes."""
    data = _data()
    twin = mirror_indices(data["mirror"])
    half = (data["female"] + data["male"]) / 2
    mirror = data["mirror"]

    def extreme(axis: int, row: str) -> int:
        return int(data[f"row_{row}"][np.argmax(half[data[f"row_{row}"], axis])])

    middle = {
        "crown": int(np.argmax(np.where(mirror, half[:, 1], -1.0))),
        "front_neck": int(data["row_neck_base"][0]),
        "back_neck": int(data["row_neck_base"][-1]),
        "crotch_point": int(data["row_crotch"][np.argmin(half[data["row_crotch"], 1])]),
        "navel": int(data["row_navel"][0]),
    }
    left = {
        "side_neck": int(data["row_shoulder_column"][-1]),
        "shoulder_point": int(data["row_shoulder_column"][0]),
        "bust_point": extreme(2, "chest"),
        "armpit_point": int(data["row_armscye"][np.argmin(half[data["row_armscye"], 1])]),
        "front_fold": int(data["row_front_fold"][0]),
        "back_fold": int(data["row_back_fold"][0]),
        "elbow_point": extreme(1, "elbow"),
        "wrist_point": extreme(1, "wrist"),
        "fingertip": int(np.argmax(half[:, 0])),
        "knee_point": extreme(2, "knee"),
        "ankle_point": extreme(0, "ankle"),
        "toe": int(np.argmax(np.where(half[:, 1] < 0.1, half[:, 2], -1.0))),
        "heel": int(np.argmin(np.where(half[:, 1] < 0.1, half[:, 2], 1.0))),
    }
    both = {f"left_{name}": vertex for name, vertex in left.items()}
    return middle | both | {f"right_{name}": int(twin[vertex]) for name, vertex in left.items()}


def mirror_indices(mirror: NDArray[np.bool_]) -> IntArray:
    """Return each half-body vertex's mirror image in the whole body; itself on the median plane, shape (H,).

    Args:
        mirror: Whether a vertex lies on the median plane, shape (H,).
    """
    twin = np.arange(len(mirror), dtype=np.int32)
    twin[~mirror] = len(mirror) + np.arange((~mirror).sum())
    return twin
