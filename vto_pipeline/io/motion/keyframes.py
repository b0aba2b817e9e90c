"""Poses at times, in YAML: angles of joints in degrees."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.io.motion.standard_skeleton import NAMES, standard_skeleton
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.kinematics import continuous_signs, quaternion_matrices, world_transforms

_ANGLE = Annotated[float, Field(ge=-360.0, le=360.0)]
_LONGEST_S, _MOST_POSES = 600.0, 1000
_ANKLE_M = 0.08


class KeyPose(Config):
    """One pose.

    Angles count from the T-pose, about the body's axes: first x (a bow), then y (a turn to the left), then z.
    """

    at_s: float = Field(default=0.0, ge=0.0, le=_LONGEST_S, description="When [s]")
    place_m: tuple[float, float] = Field(default=(0.0, 0.0), description="Where the pelvis is: to the left, ahead [m]")
    lift_m: float = Field(default=0.0, ge=-2.0, le=2.0, description="How far the lower foot is off the floor [m]")
    joints_deg: dict[str, tuple[_ANGLE, _ANGLE, _ANGLE]] = Field(
        default_factory=dict, description="Joint -> angles about x, y, z; joints left out stay in the T-pose"
    )


class KeyPoses(Config):
    """A file of poses."""

    name: str = Field(default="", max_length=200, description="What it shows")
    frames_per_second: float = Field(default=30.0, ge=1.0, le=240.0, description="Of the clip made of it")
    poses: tuple[KeyPose, ...] = Field(min_length=1, max_length=_MOST_POSES, description="In the order of their times")


def parse_keyframes(name: str) -> Arrays:
    """Read poses; between them turns follow monotone cubics (Fritsch & Carlson 1980), which overshoot nothing.

    The lower ankle stands at its height above the floor. Runs in the sandbox.

    Args:
        name: Path of a .yaml file.

    Returns:
        As `parse_bvh`.

    Raises:
        FormatError: unknown keys or joints, angles out of range, times that do not rise; with the line.
    """
    document = load_yaml(Path(name), error=FormatError)
    given: KeyPoses = check_schema(document, KeyPoses, error=FormatError)
    times = np.array([pose.at_s for pose in given.poses])
    if (np.diff(times) <= 0).any():
        k = int(np.flatnonzero(np.diff(times) <= 0)[0]) + 1
        where = document.where(("poses", k, "at_s"))
        raise FormatError(f"at_s is {times[k]:g} after {times[k - 1]:g}; times must rise", where=where)
    keys = np.tile([0.0, 0.0, 0.0, 1.0], (len(times), len(NAMES), 1))
    for k, pose in enumerate(given.poses):
        for joint, angles in pose.joints_deg.items():
            if joint not in NAMES:
                where = document.where(("poses", k, "joints_deg", joint))
                raise FormatError(f"joint {joint!r}; expected one of {', '.join(NAMES)}", where=where)
            keys[k, NAMES.index(joint)] = Rotation.from_euler("xyz", angles, degrees=True).as_quat()
    rate = given.frames_per_second
    count = round((times[-1] - times[0]) * rate) + 1
    wanted = np.minimum(times[0] + np.arange(count) / rate, times[-1])
    rotations = _between(times, continuous_signs(keys), wanted)
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    places = _between(times, np.array([[*pose.place_m, pose.lift_m] for pose in given.poses]), wanted)
    parents, offsets = standard_skeleton()
    translations = np.tile(offsets, (count, 1, 1))
    _, world = world_transforms(parents, quaternion_matrices(rotations), translations)
    ankles = [NAMES.index("left_ankle"), NAMES.index("right_ankle")]
    lowest = world[:, ankles, 1].min(axis=1)
    translations[:, 0] = np.column_stack([places[:, 0], _ANKLE_M - lowest + places[:, 2], places[:, 1]])
    return {
        "joint_names": np.array(NAMES, dtype=np.str_),
        "parents": np.array(parents, dtype=np.int64),
        "offsets": offsets,
        "rest": np.tile([0.0, 0.0, 0.0, 1.0], (len(NAMES), 1)),
        "rotations": rotations,
        "translations": translations,
        "frame_time": np.array(1.0 / rate),
        "dialect": np.array(f"{len(times)} poses in YAML"),
        "notes": np.array([], dtype=np.str_),
        "warnings": np.array([], dtype=np.str_),
    }


def _between(times: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    if len(times) == 1:
        return np.repeat(values, len(wanted), axis=0)
    found: FloatArray = PchipInterpolator(times, values, axis=0)(wanted)
    return found
