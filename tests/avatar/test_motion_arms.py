"""Arms that are kept off the body: ipctk and exact distances say whether they are."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from body_judges import meet
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.retarget import retarget
from vto_pipeline.avatar.motion.room.apart import eased
from vto_pipeline.avatar.motion.room.parts import Arms
from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.kinematics import local_rotations, matrix_vectors

SIDES = ("left", "right")
PARTS = ("shoulder", "elbow", "wrist")
ROOM = 0.015  # m
PLANES = 0.006  # m: what planes of places 50 mm apart may be off a rounded skin


@cache
def body(name: str) -> Avatar:
    """The mean woman and man, and a short and wide woman."""
    if name == "wide":
        return fit_measurements(Measurements({"stature": 1.52, "waist_girth": 1.0, "hip_girth": 1.15}, sex="female"))
    return template({"female": 0.0, "male": 1.0}[name])


def arms_hang(avatar: Avatar, angles: np.ndarray) -> np.ndarray:
    """Poses whose arms are turned down, and in, by these angles [rad], shape (T, J, 3)."""
    poses = np.zeros((len(angles), len(avatar.joints), 3))
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        poses[:, avatar.joint_names.index(f"{side}_shoulder"), 2] = sign * angles
    return poses


def parts_of(avatar: Avatar, pose: np.ndarray, parts: tuple[str, ...]) -> tuple[TriangleMesh, TriangleMesh]:
    """These parts of both arms, and the rest of the body without shoulders, in a pose."""
    owner = np.array(avatar.joint_names)[avatar.weights.argmax(axis=1)]
    mesh = TriangleMesh(pose_avatar(avatar, pose, np.zeros(3)).vertices, avatar.faces)
    chosen = np.isin(owner, [f"{side}_{part}" for side in SIDES for part in parts])
    near = np.isin(owner, [f"{side}_{part}" for side in SIDES for part in (*PARTS, "clavicle")])
    return submesh(mesh, chosen[mesh.faces].all(axis=1))[0], submesh(mesh, ~near[mesh.faces].any(axis=1))[0]


def off_body(avatar: Avatar, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses whose arms are moved off the body, and the swings."""
    turn, place = posed_joints(avatar, poses, np.tile(avatar.joints[0], (len(poses), 1)))
    arms = Arms(avatar)
    swings = arms.swings(turn, place)
    return matrix_vectors(local_rotations(avatar.parents.tolist(), arms.swung(turn, swings))), swings


@pytest.mark.parametrize("name", ["female", "male", "wide"])
def test_forearms_in_the_trunk_come_out_with_room_and_no_more(name):
    avatar = body(name)
    poses = arms_hang(avatar, np.array([1.2, 1.15]))
    for pose in poses:
        assert meet(*parts_of(avatar, pose, PARTS[1:]))
    cleared, swings = off_body(avatar, poses)
    assert (np.linalg.norm(swings, axis=2) > 0.02).all()
    for pose in cleared:
        arm, rest = parts_of(avatar, pose, PARTS[1:])
        assert not meet(arm, rest)
    own = np.isin(avatar.weights.argmax(axis=1), [avatar.joint_names.index(f"left_{part}") for part in PARTS])
    own &= avatar.weights.max(axis=1) > 0.95
    shoulder = avatar.joints[avatar.joint_names.index("left_shoulder")]
    far = np.linalg.norm(avatar.bind_vertices - shoulder, axis=1)
    for pose in cleared:
        _, rest = parts_of(avatar, pose, PARTS)
        places = SurfaceDistance(rest).nearest(pose_avatar(avatar, pose, np.zeros(3)).vertices).distance
        assert places[own & (far > 0.12)].min() > ROOM - PLANES
        assert places[own & (far > 0.07)].min() < ROOM + 4 * PLANES  # planes rise towards the armpit


def test_only_the_shoulders_turn_and_arms_with_room_stay_as_they_are():
    avatar = body("female")
    poses = arms_hang(avatar, np.array([1.1, 0.0, -0.8]))
    poses[1:, avatar.joint_names.index("left_elbow")] = [0.1, -0.6, 0.0]
    cleared, swings = off_body(avatar, poses)
    assert (swings[1:] == 0.0).all()
    np.testing.assert_allclose(cleared[1:], poses[1:], rtol=0, atol=1e-12)  # rounding
    others = [k for k, name in enumerate(avatar.joint_names) if not name.endswith("_shoulder")]
    np.testing.assert_allclose(cleared[:, others], poses[:, others], rtol=0, atol=1e-12)


def test_a_hand_in_the_belly_goes_ahead_and_not_around():
    avatar = body("male")
    pose = arms_hang(avatar, np.array([0.2]))
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        shoulder, elbow = (avatar.joint_names.index(f"{side}_{joint}") for joint in ("shoulder", "elbow"))
        inward = Rotation.from_rotvec(1.2 * np.array([1.0, -1.0, 0.0]) / np.sqrt(2) * [1.0, sign, sign])
        pose[0, shoulder] = (Rotation.from_rotvec(pose[0, shoulder]) * inward).as_rotvec()
        pose[0, elbow] = 1.7 * np.array([-1.0, -sign, 0.0]) / np.sqrt(2)
    hand, rest = parts_of(avatar, pose[0], ("wrist",))
    assert SurfaceDistance(rest).signed(hand.vertices).distance.min() < -0.03
    cleared, _ = off_body(avatar, pose)
    arm, rest = parts_of(avatar, cleared[0], PARTS[1:])
    assert not meet(arm, rest)
    moved = parts_of(avatar, cleared[0], ("wrist",))[0].vertices - hand.vertices
    assert np.linalg.norm(moved, axis=1).max() < 0.25
    assert (moved[:, 2] > 0.0).all()


def test_eased_swings_are_whole_where_they_are_largest_and_never_jump():
    swings = np.zeros((40, 2, 3))
    swings[20, 0] = [0.0, 0.3, 0.4]
    swings[:, 1] = [0.1, 0.0, -0.2]
    found = eased(swings, 0.15, 1 / 30)
    np.testing.assert_allclose(found[:, 1], swings[:, 1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(found[20, 0], swings[20, 0], rtol=0, atol=1e-15)
    size = np.linalg.norm(found[:, 0], axis=1)
    assert (np.diff(size[:21]) >= -1e-15).all()
    np.testing.assert_allclose(size, size[::-1][np.r_[39, 0:39]], rtol=0, atol=1e-15)  # as fast back as out
    assert abs(np.diff(size)).max() < 0.5 / 4  # 5 frames on either side: the largest weight of Hann's window is 1 / 6
    assert (size[:10] == 0.0).all()


@pytest.mark.parametrize("name", ["female", "wide"])
def test_a_preset_with_hanging_arms_comes_without_arms_in_the_body(name):
    avatar, read = body(name), read_motion("arms_down")
    motion, figures = retarget(read.clip, read.joints, avatar)
    assert figures.arms_moved == 1.0
    assert not meet(*parts_of(avatar, motion.poses[-1], PARTS[1:]))
