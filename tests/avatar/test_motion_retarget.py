"""Motions carried over: onto the same body they are the same, onto others planted feet stand still."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.motion.figures import crossing_frames
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.motion.soles import contact_places
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import InputError
from vto_pipeline.io.motion.joint_map import map_joints
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.io.motion.upright import rest_places
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import AvatarMotion, Clip
from vto_pipeline.numerics.kinematics import matrix_quaternions, quaternion_matrices, vector_matrices, world_transforms

REAL = Path(__file__).parents[2].parent / "shared" / "data" / "motion"
CLIPS = ("cmu_131_bvh/131_01", "cmu_131_bvh/131_02", "cmu_131_bvh/131_03", "pymo_bvh/AV_8Walk_Meredith_HVHA_Rep1")
BONES = (("shoulder", "elbow"), ("elbow", "wrist"))


@cache
def body(name: str) -> Avatar:
    """Three bodies: the mean woman, the mean man, and a short and wide woman."""
    if name == "wide":
        return fit_measurements(Measurements({"stature": 1.52, "waist_girth": 1.0, "hip_girth": 1.15}, sex="female"))
    return template({"female": 0.0, "male": 1.0}[name])


def clip_of(avatar: Avatar, poses: np.ndarray, places: np.ndarray, frame_time: float = 1 / 30) -> Clip:
    """An avatar's own skeleton as a clip."""
    parents = avatar.parents
    offsets = np.array([avatar.joints[j] - (avatar.joints[p] if p >= 0 else 0) for j, p in enumerate(parents)])
    translations = np.tile(offsets, (len(poses), 1, 1))
    translations[:, 0] += places
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (len(parents), 1))
    turns = matrix_quaternions(vector_matrices(poses))
    return Clip(avatar.joint_names, parents, offsets, rest, turns, translations, frame_time)


def mapped(clip: Clip):
    return map_joints(clip.joint_names, clip.parents.tolist(), rest_places(clip)[1], "here")


def test_a_motion_onto_the_body_it_came_from_is_the_same():
    avatar = body("female")
    rng = np.random.default_rng(9)
    poses = rng.uniform(-0.4, 0.4, (12, len(avatar.joints), 3))
    for kind in ("hip", "knee"):  # no leg bent the wrong way
        for side in ("left", "right"):
            poses[:, avatar.joint_names.index(f"{side}_{kind}"), 1:] *= 0.3
            x = poses[:, avatar.joint_names.index(f"{side}_{kind}"), 0]
            x[:] = abs(x) * (1 if kind == "knee" else -1)
    for side, sign in (("left", 1.0), ("right", -1.0)):  # no limb near the trunk or another: it would be moved off
        poses[:, avatar.joint_names.index(f"{side}_shoulder"), 2] += sign * 0.6
        poses[:, avatar.joint_names.index(f"{side}_hip"), 2] += sign * 0.2
    places = rng.uniform(-0.3, 0.3, (12, 3))
    clip = clip_of(avatar, poses, places)
    motion, figures = retarget(clip, mapped(clip), avatar, RetargetConfig(hold_feet=False))
    assert figures.plants == 0
    np.testing.assert_allclose(motion.poses, poses, rtol=0, atol=1e-9)  # rounding
    moved = motion.translations - places
    np.testing.assert_allclose(moved - moved[0], 0.0, rtol=0, atol=1e-9)


def test_the_root_moves_by_the_ratio_of_the_legs():
    small, large = body("wide"), body("male")
    places = np.linspace(0, 1, 20)[:, None] * [0.3, 0.1, 2.0]
    clip = clip_of(large, np.zeros((20, len(large.joints), 3)), places)
    motion, _ = retarget(clip, mapped(clip), small, RetargetConfig(hold_feet=False))

    def leg(avatar: Avatar) -> float:
        at = {name: avatar.joints[k] for k, name in enumerate(avatar.joint_names)}
        bones = (("left_hip", "left_knee"), ("left_knee", "left_ankle"))
        return sum(float(np.linalg.norm(at[a] - at[b])) for a, b in bones)

    way = (motion.translations - motion.translations[0])[-1]
    np.testing.assert_allclose(way, leg(small) / leg(large) * places[-1], rtol=1e-6)  # both legs of a body are alike


def test_bones_point_where_they_point_in_the_source():
    read, avatar = read_motion("arms_up"), body("wide")  # its rest is a T-pose, the avatar's an A-pose
    motion, _ = retarget(read.clip, read.joints, avatar)
    _, there = world_transforms(read.clip.parents, quaternion_matrices(read.clip.rotations), read.clip.translations)
    _, here = posed_joints(avatar, motion.poses, avatar.joints[0] + motion.translations)
    for side in ("left", "right"):
        for a, b in BONES:
            start, end = f"{side}_{a}", f"{side}_{b}"
            theirs = there[0, read.joints.indices[end]] - there[0, read.joints.indices[start]]
            ours = here[0, avatar.joint_names.index(end)] - here[0, avatar.joint_names.index(start)]
            unit = [way / np.linalg.norm(way) for way in (ours, theirs)]
            np.testing.assert_allclose(unit[0], unit[1], rtol=0, atol=1e-9)  # rounding


def test_a_skeleton_that_lies_down_throughout_is_refused():
    avatar = body("male")
    clip = clip_of(avatar, np.zeros((3, len(avatar.joints), 3)), np.zeros((3, 3)))
    offsets = clip.offsets.copy()
    for side in ("left", "right"):
        offsets[avatar.joint_names.index(f"{side}_knee")] = [0.0, 0.4, 0.0]  # knees above the hips
    folded = Clip(clip.joint_names, clip.parents, offsets, clip.rest, clip.rotations, np.tile(offsets, (3, 1, 1)), 0.1)
    with pytest.raises(InputError, match="neither at rest nor in the first frame"):
        retarget(folded, mapped(folded), avatar)


@pytest.mark.parametrize("name", ["female", "male", "wide"])
def test_presets_stand_on_the_floor(name):
    for preset in ("t_pose", "arms_up", "sitting", "walking_step"):
        read = read_motion(preset)
        motion, figures = retarget(read.clip, read.joints, body(name))
        assert motion.planted.any()
        assert figures.drift_after < 1e-6
        assert figures.below_floor < 0.002
        assert figures.spikes_after == 0


def test_walking_on_the_spot_is_said():
    avatar = body("female")
    poses = np.zeros((60, len(avatar.joints), 3))
    swing = 0.5 * np.sin(2 * np.pi * np.arange(60) / 30)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        poses[:, avatar.joint_names.index(f"{side}_hip"), 0] = sign * swing
        poses[:, avatar.joint_names.index(f"{side}_ankle"), 0] = -sign * swing
    clip = clip_of(avatar, poses, np.zeros((60, 3)))
    job = Job()
    retarget(clip, mapped(clip), avatar, job=job)
    assert any("on the spot" in text for text in job.warnings)


@pytest.mark.parametrize("rate", [10, 30, 240])
def test_a_leap_is_named_with_its_time_and_size(rate):
    """Of a root at 1.2 m/s, where frames are lost. A slip of 0.02 m is none, nor is the swing of a leg."""
    avatar, count = body("female"), 2 * rate
    times = np.arange(count) / rate
    poses = np.zeros((count, len(avatar.joints), 3))
    poses[:, avatar.joint_names.index("left_hip"), 0] = 0.4 * np.sin(2 * np.pi * times)
    size = 0.5 if rate == 10 else 0.1  # m: in a tenth of a second people get so far
    for leap in (0.0, 0.02, size):
        places = np.stack([0.0 * times, 0.0 * times, 1.2 * times], axis=1)
        places[times >= 1.0 - 1e-9, 0] += leap
        clip = clip_of(avatar, poses, places, 1 / rate)
        job = Job()
        retarget(clip, mapped(clip), avatar, RetargetConfig(hold_feet=False), job)
        found = [text for text in job.warnings if "leaps" in text]
        assert len(found) == (leap == size)
    said = re.fullmatch(r"the motion leaps at 1\.00 s: .* by (\d+) mm from one frame to the next; .*", found[0])
    assert float(said[1]) == pytest.approx(1e3 * size, rel=0.1)  # the leg swings on meanwhile


def test_arms_through_the_body_are_seen():
    avatar = body("male")
    poses = np.zeros((2, len(avatar.joints), 3))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        poses[1, avatar.joint_names.index(f"{side}_shoulder"), 2] = sign * 1.2
    still = np.zeros((2, 4), dtype=bool)
    assert crossing_frames(AvatarMotion(avatar.joint_names, poses, np.zeros((2, 3)), still, 0.1), avatar, 5) == (1, 2)


@pytest.mark.real_data
@pytest.mark.skipif(not REAL.exists(), reason="real motion is absent")
@pytest.mark.parametrize(
    ("clip", "name"),
    [
        pytest.param(clip, name, marks=() if k % 2 == 0 and (k + n) % 3 == 0 else pytest.mark.slow)
        for k, clip in enumerate(CLIPS)
        for n, name in enumerate(("female", "male", "wide"))
    ],
)
def test_planted_feet_of_real_clips_drift_by_less_than_two_millimetres(clip, name):
    avatar = body(name)
    read = read_motion(REAL / f"{clip}.bvh")
    motion, figures = retarget(read.clip, read.joints, avatar)
    turn, place = posed_joints(avatar, motion.poses, avatar.joints[0] + motion.translations)
    contacts = contact_places(turn, place, avatar)
    drift = 0.0
    for n in range(4):  # counted here anew
        edges = np.flatnonzero(np.diff(np.concatenate([[0], motion.planted[:, n].astype(int), [0]])))
        for first, end in edges.reshape(-1, 2):
            there = contacts[first:end, n]
            drift = max(drift, float(np.linalg.norm(there - there[0], axis=1).max()))
    assert drift <= 0.002
    assert figures.plants > 10
    assert figures.drift_before > 0.01
    assert figures.spikes_after == 0
    assert contacts[..., 1].min() > -1e-3
    assert crossing_frames(motion, avatar, 6)[0] == 0
    assert abs(contacts[..., 1][motion.planted]).max() < 0.001
