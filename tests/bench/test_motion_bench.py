"""The benches of motions: known crossings are counted by ipctk, and limbs are off by known turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.align import carry_over
from vto_pipeline.avatar.template.template import template
from vto_pipeline.bench.motion.garments import run_figures
from vto_pipeline.bench.motion.ipc_frames import crossing_frames
from vto_pipeline.bench.motion.limb_angles import limb_angles
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.io.bodies.avatars import write_avatar
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.motion.archive import write_avatar_motion
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.io.runs.frame_log import write_cloth_motion
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.job import Job
from vto_pipeline.model.motion import AvatarMotion, ClothMotion
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors

SIZE = 0.02  # m: edges of the patches
PATCHES = np.array([[0, 1, 2], [3, 4, 5]], np.int32)
AUDIT = (
    *("frames", "frames_crossing_body", "most_body_crossings", "frames_crossing_itself", "frames_body_crossing_itself"),
    *("body_yields_mm", "penetration_mm", "max_stretch", "max_thread_stretch", "p99_thread_stretch"),
    *("max_shear_deg", "seconds_per_frame"),
    *("cpu_seconds_per_frame", "most_cpu_seconds"),
)
BEYOND = {"warp": 0.25, "weft": None, "shear": 0.0}


def patches(center: np.ndarray, apart: float = 2 * SIZE, size: float = SIZE) -> np.ndarray:
    """Two triangles at a place, level and upright, the second above; where they are not apart, each in the other."""
    level = size * np.array([[-0.5, 0.0, -0.4], [0.5, 0.0, -0.4], [0.0, 0.0, 0.6]])
    upright = size * np.array([[-0.5, -0.4, 0.0], [0.5, -0.4, 0.0], [0.0, 0.6, 0.0]]) + [0.0, apart, 0.0]
    return center + np.concatenate([level, upright])


def posed(avatar: Avatar, poses: list[np.ndarray]) -> AvatarMotion:
    count = len(poses)
    still = np.zeros((count, 4), dtype=bool)
    return AvatarMotion(avatar.joint_names, np.array(poses), np.zeros((count, 3)), still, 1 / 30)


def test_frames_that_cross_body_or_cloth_are_counted(tmp_path):
    avatar = template(0.5)
    navel = avatar.vertices[avatar.landmarks["navel"]]
    before, within = navel + np.array([0.0, 0.0, 0.1]), navel - np.array([0.0, 0.0, 0.08])
    frames = [patches(before), patches(navel), patches(before, apart=0.0), patches(before + 0.01), patches(within)]
    cloth = ClothMotion(np.stack(frames), PATCHES, 1 / 30)
    motion = posed(avatar, [avatar.pose] * len(frames))
    assert crossing_frames(cloth, avatar, motion) == (2, 2)  # what is all within crosses nothing
    (tmp_path / "out" / "partial").mkdir(parents=True)
    write_avatar(tmp_path / "body.npz", avatar)
    write_avatar_motion(tmp_path / "out" / "motion.npz", motion)
    write_cloth_motion(tmp_path / "out" / "partial" / "draped_motion.npz", cloth)
    write_json(tmp_path / "out" / "partial" / "motion_audit.json", dict.fromkeys(AUDIT, 0) | {"beyond_limits": BEYOND})
    found = run_figures(tmp_path, tmp_path / "body.npz")
    assert (found["ipc_crossing"], found["ipc_crossing_posed"], found["vertices"]) == (2, 2, 6)
    assert run_figures(tmp_path / "out", tmp_path / "body.npz") == {}


def test_cloth_between_arm_and_flank_crosses_the_posed_skin_and_not_the_sunken():
    avatar = template(0.5)
    hangs = avatar.pose.copy()
    hangs[avatar.joint_names.index("left_shoulder"), 2] = -0.7  # rad: the upper arm presses on the flank
    body = pose_avatar(avatar, hangs, np.zeros(3))
    owner = np.array(avatar.joint_names)[avatar.weights.argmax(axis=1)][avatar.faces[:, 0]]
    pairs = self_intersections(body.mesh)
    pairs = pairs[(owner[pairs] == "left_shoulder").sum(axis=1) == 1]
    at = body.vertices[avatar.faces[pairs]].mean(axis=(1, 2))
    lowest = at[:, 1].argmin()
    between = avatar.vertices[avatar.faces[pairs[lowest]]].mean(axis=(0, 1))
    frames = [patches(place, apart=0.02, size=0.005) for place in (between, at[lowest])]
    cloth, motion = ClothMotion(np.stack(frames), PATCHES, 1 / 30), posed(avatar, [avatar.pose, hangs])
    assert crossing_frames(cloth, avatar, motion) == (0, 1)


def test_limbs_that_were_turned_are_off_by_as_much():
    read, avatar = read_motion("t_pose"), template(1.0)
    turn, root = carry_over(read.clip, read.joints, avatar, Job())
    poses = matrix_vectors(local_rotations(avatar.parents.tolist(), turn))
    motion = AvatarMotion(avatar.joint_names, poses, root - avatar.joints[0], np.zeros((1, 4), bool), 1 / 30)
    assert max(angles.max() for angles in limb_angles(read, avatar, motion).values()) < 1e-9  # rounding
    poses, knee = poses.copy(), avatar.joint_names.index("right_knee")
    poses[0, knee] = (Rotation.from_rotvec(poses[0, knee]) * Rotation.from_rotvec([0.3, 0.0, 0.0])).as_rotvec()
    found = limb_angles(read, avatar, replace(motion, poses=poses))
    assert list(found) == ["upper arms", "forearms", "thighs", "shanks"]
    shank = avatar.joints[avatar.joint_names.index("right_ankle")] - avatar.joints[knee]
    bent = Rotation.from_rotvec([0.3, 0.0, 0.0]).apply(shank)
    truth = np.arccos(shank @ bent / (shank @ shank))
    np.testing.assert_allclose(found["shanks"], [0.0, truth], rtol=0, atol=1e-6)  # of the arc cosine
    assert found["thighs"].max() < 1e-9
