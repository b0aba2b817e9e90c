"""Pose and morph."""

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.pose import morph, named_pose, pose_avatar
from vto_pipeline.avatar.template import template
from vto_pipeline.errors import InputError


def test_no_pose_is_the_bind_pose() -> None:
    body = template(0.5)
    still = pose_avatar(body, np.zeros((len(body.joints), 3)), np.zeros(3))
    assert_allclose(still.vertices, body.bind_vertices, rtol=0, atol=1e-12)  # weights sum to 1 to rounding


def test_turning_the_root_turns_the_body_rigidly() -> None:
    body = template(0.5)
    pose = np.zeros((len(body.joints), 3))
    pose[0] = [0.2, 0.9, -0.1]
    turn = Rotation.from_rotvec(pose[0])
    shift = np.array([0.1, 0.2, 0.3])
    got = pose_avatar(body, pose, shift).vertices
    true = turn.apply(body.bind_vertices - body.joints[0]) + body.joints[0] + shift
    assert_allclose(got, true, rtol=0, atol=1e-12)


def test_elbow_bends_the_forearm_about_the_elbow() -> None:
    body = template(0.5)
    elbow, hand = body.joint_names.index("left_elbow"), body.landmarks["left_fingertip"]
    pose = np.zeros((len(body.joints), 3))
    pose[elbow] = [0, -1.0, 0]
    got = pose_avatar(body, pose, np.zeros(3)).vertices
    true = Rotation.from_rotvec([0, -1.0, 0]).apply(body.bind_vertices[hand] - body.joints[elbow]) + body.joints[elbow]
    assert_allclose(got[hand], true, rtol=0, atol=1e-9)  # the fingertip hangs on the wrist alone
    foot = body.landmarks["left_toe"]
    assert_allclose(got[foot], body.bind_vertices[foot], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "angle"), [("a_pose", 45), ("t_pose", 0), ("arms_down", 78)])
def test_named_poses(name: str, angle: float) -> None:
    body = named_pose(template(0.0), name)
    mesh = trimesh.Trimesh(body.vertices, body.faces, process=False)
    arm = body.vertices[body.loops["left_wrist"]].mean(0) - body.vertices[body.loops["left_elbow"]].mean(0)
    assert_allclose(np.degrees(np.arctan2(-arm[1], arm[0])), angle, rtol=0, atol=2)  # sections are not quite centred
    assert_allclose(mesh.volume, trimesh.Trimesh(body.bind_vertices, body.faces).volume, rtol=0.02)  # linear blending
    assert abs(body.vertices[:, 1].min()) < 1e-9


def test_unknown_pose() -> None:
    with pytest.raises(InputError, match="lotus"):
        named_pose(template(0.0), "lotus")


def test_morph_starts_and_ends_exactly_and_is_smooth() -> None:
    source, target = named_pose(template(0.0), "arms_down"), template(1.0)
    moving = morph(source, target, 9)
    assert_allclose(moving.keyframes[0], source.vertices, rtol=0, atol=0)
    assert_allclose(moving.keyframes[-1], target.vertices, rtol=0, atol=0)
    steps = np.linalg.norm(np.diff(moving.keyframes, axis=0), axis=2)
    assert_allclose(steps[0], steps[-1], rtol=0.25, atol=2e-3)  # even speed along arcs
    volumes = [trimesh.Trimesh(k, moving.faces, process=False).volume for k in moving.keyframes]
    assert (np.diff(volumes) > 0).all(), "a woman grows into a larger man without shrinking on the way"


def test_morph_halfway_of_a_turn_is_half_the_turn() -> None:
    body = template(0.5)
    pose = np.zeros((len(body.joints), 3))
    pose[0, 1] = np.pi / 2
    turned = pose_avatar(body, pose, np.zeros(3))
    pose[0, 1] = np.pi / 4
    half = pose_avatar(body, pose, np.zeros(3))
    assert_allclose(morph(body, turned, 3).keyframes[1], half.vertices, rtol=0, atol=1e-12)
