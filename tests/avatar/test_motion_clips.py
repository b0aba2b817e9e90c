"""Recordings by others: where their own hierarchy puts each joint, and where the avatar's limbs point."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import ipctk
import numpy as np
import pytest
import trimesh
from slow_cases import every

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.align import carry_over
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.kinematics import (
    local_rotations,
    matrix_vectors,
    quaternion_matrices,
    vector_matrices,
    world_transforms,
)

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "motion"
CLIPS = (
    "makehuman_walk1",
    "makehuman_tpose",
    "cmu_131_bvh/131_01",
    "cmu_131_bvh/131_02",
    "cmu_131_bvh/131_03",
    "pymo_bvh/AV_8Walk_Meredith_HVHA_Rep1",
)
LIMBS = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))
NOTHING = 1e-3  # of the file's unit, a tenth of a metre where it matters
Y_UP = {"+Y": np.eye(3), "+Z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])}

pytestmark = [pytest.mark.real_data, pytest.mark.skipif(not REAL.exists(), reason="real motion is absent")]


@cache
def truth(path: Path, frames: int = 25) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Joint -> its places from the root in some frames, in the file's unit and axes, by 4x4 matrices; which frames.

    A joint's channels are applied in the order of the file. Its place replaces the offset, unless it is about zero:
    MakeHuman's rig has such places, which would make a point of the body, and count from the offsets.
    """
    head, _, motion = path.read_text().partition("MOTION")
    values = np.array(motion.split()[5:], dtype=float).reshape(int(motion.split()[1]), -1)
    some = np.unique(np.linspace(0, len(values) - 1, frames).astype(int))
    open_joints: list[np.ndarray] = [np.tile(np.eye(4), (len(some), 1, 1))]
    found: dict[str, np.ndarray] = {}
    name, column, words = None, 0, iter(head.split())
    for word in words:
        if word in ("ROOT", "JOINT"):
            name = next(words)
        elif word == "End":
            name = None
        elif word == "{":
            open_joints.append(open_joints[-1].copy())
        elif word == "}":
            open_joints.pop()
        elif word == "OFFSET":
            step = np.tile(np.eye(4), (len(some), 1, 1))
            step[:, :3, 3] = [float(next(words)) for _ in range(3)]
            open_joints[-1] = open_joints[-2] @ step
        elif word == "CHANNELS":
            kinds = [next(words) for _ in range(int(next(words)))]
            own = values[some, column : column + len(kinds)].T
            column += len(kinds)
            if any(kind.endswith("position") for kind in kinds):
                step[:, :3, 3] = own[:3].T + (step[:, :3, 3] if abs(own[:3]).max() < NOTHING else 0.0)
            for kind, degrees in zip(kinds, own, strict=True):
                if kind.endswith("rotation"):
                    axis = np.eye(3)["XYZ".index(kind[0])]
                    step = step @ [trimesh.transformations.rotation_matrix(np.deg2rad(d), axis) for d in degrees]
            open_joints[-1] = open_joints[-2] @ step
        if word in ("OFFSET", "CHANNELS") and name is not None:
            found[name] = open_joints[-1][:, :3, 3]
    assert column == values.shape[1]
    root = next(iter(found.values())).copy()
    return {joint: place - root for joint, place in found.items()}, some


@pytest.mark.parametrize("clip", CLIPS)
def test_joints_are_where_the_file_puts_them(clip):
    path = REAL / f"{clip}.bvh"
    read, (places, some) = read_motion(path), truth(path)
    _, found = world_transforms(
        read.clip.parents, quaternion_matrices(read.clip.rotations[some]), read.clip.translations[some]
    )
    found = found - found[:, :1]
    assert len(places) == sum(not name.endswith("_end") for name in read.clip.joint_names) > 20
    for name, place in places.items():
        turned = read.axes.metres * place @ Y_UP[read.axes.up].T
        np.testing.assert_allclose(found[:, read.clip.joint_names.index(name)], turned, rtol=0, atol=1e-9)  # rounding


@pytest.mark.parametrize("man", [0.0, 1.0])
@pytest.mark.parametrize("clip", CLIPS)
def test_limbs_point_where_the_file_puts_them(clip, man):
    """As they are carried over: then feet are held, and arms kept off the body."""
    path, avatar = REAL / f"{clip}.bvh", template(man)
    read, (places, some) = read_motion(path), truth(path)
    turn, root = carry_over(read.clip, read.joints, avatar, Job())
    poses = matrix_vectors(local_rotations(avatar.parents.tolist(), turn[some]))
    _, found = posed_joints(avatar, poses, root[some])
    for side in ("left", "right"):
        for start, end in LIMBS:
            names = [read.clip.joint_names[read.joints.indices[f"{side}_{joint}"]] for joint in (start, end)]
            theirs = (places[names[1]] - places[names[0]]) @ Y_UP[read.axes.up].T
            begin, tip = (avatar.joint_names.index(f"{side}_{joint}") for joint in (start, end))
            ours = found[:, tip] - found[:, begin]
            unit = [way / np.linalg.norm(way, axis=1, keepdims=True) for way in (ours, theirs)]
            # MakeHuman's places near zero shift joints by 1e-4 of a bone; all else agrees to rounding
            np.testing.assert_allclose(unit[0], unit[1], rtol=0, atol=1e-4 if clip == "makehuman_tpose" else 1e-9)


@pytest.mark.parametrize("clip", every(3, CLIPS))
def test_the_way_into_a_recording_turns_no_joint_further_than_its_first_frame(clip):
    avatar, read = template(0.0), read_motion(REAL / f"{clip}.bvh")
    config = RetargetConfig(frames_per_second=30.0, lead_in_s=1.0)
    motion, _ = retarget(read.clip, read.joints, avatar, config)
    start = np.swapaxes(vector_matrices(avatar.pose), -1, -2)
    turned = np.linalg.norm(matrix_vectors(vector_matrices(motion.poses[:31]) @ start), axis=2)
    assert (np.diff(turned, axis=0) > -1e-9).all()
    assert turned[-1].max() > 0.5


def test_a_runner_sets_out_without_a_hand_in_a_shank():
    """By ipctk. A curve that arrived at the clip's speed bent a knee by 137 degrees, where the clip has 82 at most."""
    avatar, read = template(0.0), read_motion(REAL / "makehuman_walk1.bvh")
    motion, _ = retarget(read.clip, read.joints, avatar, RetargetConfig(frames_per_second=30.0, lead_in_s=1.0))
    knees = [avatar.joint_names.index(f"{side}_knee") for side in ("left", "right")]
    bent = np.linalg.norm(motion.poses[:, knees], axis=2)
    assert bent[:30].max() <= bent[30:].max()
    thighs = [avatar.joint_names.index(f"{side}_hip") for side in ("left", "right")]
    owner = avatar.weights.argmax(axis=1)[avatar.faces]
    parts = avatar.faces[~np.isin(owner, thighs).any(axis=1)]  # thighs touch in the recording itself
    edges = trimesh.Trimesh(avatar.bind_vertices, parts, process=False).edges_unique
    mesh = ipctk.CollisionMesh(avatar.bind_vertices, edges, parts)
    for pose, place in zip(motion.poses[:42], motion.translations[:42], strict=True):
        assert not ipctk.has_intersections(mesh, np.asarray(pose_avatar(avatar, pose, place).vertices))
