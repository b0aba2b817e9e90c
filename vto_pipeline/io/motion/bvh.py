"""BVH: any order of channels, places on any joint, lost frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.motion.bvh_frames import read_frames
from vto_pipeline.io.motion.bvh_hierarchy import BvhJoint, read_hierarchy
from vto_pipeline.io.motion.gaps import fill_gaps
from vto_pipeline.io.text_numbers import read_lines
from vto_pipeline.model.arrays import FloatArray

MOST_TURNS = 5_000_000
"""Frames times joints that are read."""


def parse_bvh(name: str) -> Arrays:
    """Read a BVH file. Runs in the sandbox.

    Rotations are intrinsic, in the order of the channels (Meredith & Maddock 2001). A place on a joint counts from its
    parent or from its offset: whichever leaves the bone nearer to its length at rest.

    Args:
        name: Path of the file.

    Returns:
        joint_names, parents, offsets, rest, rotations, translations as `Clip` has them, in the file's unit and axes;
        frame_time; dialect in words; notes and warnings.

    Raises:
        FormatError: the file breaks the format; with the line.
    """
    path = Path(name)
    lines = read_lines(path)
    joints, start = read_hierarchy(lines, path)
    channels = sum(len(joint.channels) for joint in joints)
    read = read_frames(lines, start, channels, path)
    frames = len(read.values)
    if frames * len(joints) > MOST_TURNS:
        problem = f"{frames} frames of {len(joints)} joints; at most {MOST_TURNS} turns are read"
        raise FormatError(problem, where=name, hint="cut the clip")
    offsets = np.array([joint.offset for joint in joints])
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(joints), 1))
    translations = np.tile(offsets, (frames, 1, 1))
    first = 0
    for j, joint in enumerate(joints):
        values = read.values[:, first : first + len(joint.channels)]
        first += len(joint.channels)
        if joint.turns:
            order = "".join(joint.channels[k][0] for k in joint.turns).upper()
            rotations[:, j] = _turns(order, values[:, joint.turns])
        if joint.positions:
            axes = ["xyz".index(joint.channels[k][0]) for k in joint.positions]
            places = values[:, joint.positions]
            given = places[~read.lost]
            from_parent = np.median(abs(given - offsets[j, axes]).sum(axis=1)) if len(given) else 0.0
            from_offset = np.median(abs(given).sum(axis=1)) if len(given) else 1.0
            translations[:, j, axes] = places if from_parent <= from_offset else places + offsets[j, axes]
    rotations, translations, warnings = fill_gaps(rotations, translations, read.lost, read.frame_time, path)
    return {
        "joint_names": np.array([joint.name for joint in joints], dtype=np.str_),
        "parents": np.array([joint.parent for joint in joints], dtype=np.int64),
        "offsets": offsets,
        "rest": rotations[0] * 0.0 + [0.0, 0.0, 0.0, 1.0],
        "rotations": rotations,
        "translations": translations,
        "frame_time": np.array(read.frame_time),
        "dialect": np.array(_dialect(joints)),
        "notes": np.array([], dtype=np.str_),
        "warnings": np.array([*read.warnings, *warnings], dtype=np.str_),
    }


def _turns(order: str, degrees: FloatArray) -> FloatArray:
    """Quaternions of intrinsic rotations about one, two or three axes, shape (T, 4)."""
    turn = Rotation.identity(len(degrees))
    for axis, column in zip(order, degrees.T, strict=True):
        turn = turn * Rotation.from_euler(axis, column[:, None], degrees=True)
    quaternions: FloatArray = turn.as_quat()
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def _dialect(joints: list[BvhJoint]) -> str:
    """What tells this file from others, in words."""
    orders = {"".join(joint.channels[k][0] for k in joint.turns).upper() for joint in joints if joint.turns}
    placed = sum(bool(joint.positions) for joint in joints)
    where = "no joint" if placed == 0 else "the root" if placed == 1 and joints[0].positions else f"{placed} joints"
    return f"BVH, rotations {' and '.join(sorted(orders)) or 'none'}, places on {where}"
