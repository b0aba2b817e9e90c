"""Hands off the head, legs off legs and a trunk off its thighs: every edge is held against every triangle."""

from __future__ import annotations

import numpy as np
import pytest
from body_judges import cross
from scipy.spatial import cKDTree

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.figures import spikes
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.retarget import _halves
from vto_pipeline.avatar.motion.room.apart import Apart, _heights
from vto_pipeline.avatar.motion.room.parts import Arms, Legs, Trunk
from vto_pipeline.avatar.template.template import template
from vto_pipeline.geometry.topology import submesh
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh

FRAME_TIME = 1 / 30


def part(avatar: Avatar, pose: np.ndarray, names: tuple[str, ...]) -> TriangleMesh:
    """What of the posed skin goes with these joints."""
    chosen = np.isin(np.array(avatar.joint_names)[avatar.weights.argmax(axis=1)], names)
    mesh = TriangleMesh(pose_avatar(avatar, pose, np.zeros(3)).vertices, avatar.faces)
    return submesh(mesh, chosen[mesh.faces].all(axis=1))[0]


def kept(apart: Apart, avatar: Avatar, poses: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Poses with room."""
    return apart.kept(poses, np.tile(avatar.joints[0], (len(poses), 1)), free, FRAME_TIME)[0]


def turned(avatar: Avatar, turns: dict[str, tuple[float, float, float]], frames: int = 1) -> np.ndarray:
    """Poses whose joints are turned so [rad], shape (T, J, 3)."""
    poses = np.zeros((frames, len(avatar.joints), 3))
    for name, vector in turns.items():
        poses[:, avatar.joint_names.index(name)] = vector
    return poses


@pytest.mark.parametrize(
    ("sex", "shoulder", "elbow"),
    [(0.0, (-1.05, 1.09, 0.0), (-1.56, 1.43, -0.81)), (1.0, (-0.89, 0.87, -0.27), (-1.55, 1.6, -0.82))],
)
def test_a_hand_in_the_head_comes_out_and_the_other_stays(sex, shoulder, elbow):
    avatar = template(sex)
    poses = turned(avatar, {"right_shoulder": shoulder, "right_elbow": elbow})
    hand, head = (("right_wrist", "right_elbow"), ("head", "neck"))
    assert cross(part(avatar, poses[0], hand), part(avatar, poses[0], head))
    cleared = kept(Arms(avatar), avatar, poses, np.ones((1, 2)))
    assert not cross(part(avatar, cleared[0], hand), part(avatar, cleared[0], head))
    moved = [j for j in range(len(avatar.joints)) if abs(cleared[0, j] - poses[0, j]).max() > 1e-9]
    assert moved == [avatar.joint_names.index("right_shoulder")]


@pytest.mark.parametrize("sex", [0.0, 1.0])
def test_a_trunk_bent_into_its_thighs_leans_off_them(sex):
    avatar = template(sex)
    bent = {f"{side}_hip": (-2.3, 0.0, 0.0) for side in ("left", "right")} | {
        "spine": (0.5, 0.0, 0.0),
        "chest": (0.5, 0.0, 0.0),
    }
    poses = turned(avatar, bent)
    chest, thighs = ("chest",), ("left_hip", "right_hip", "left_knee", "right_knee")
    assert cross(part(avatar, poses[0], chest), part(avatar, poses[0], thighs))
    cleared = kept(Trunk(avatar), avatar, poses, np.ones((1, 1)))
    assert not cross(part(avatar, cleared[0], chest), part(avatar, cleared[0], thighs))
    others = [j for j, name in enumerate(avatar.joint_names) if name != "spine"]
    np.testing.assert_allclose(cleared[:, others], poses[:, others], rtol=0, atol=1e-9)


def test_only_the_leg_that_is_free_goes_around_the_other():
    avatar = template(1.0)
    poses = turned(avatar, {"right_hip": (0.0, 0.0, 0.35), "right_knee": (0.1, 0.0, 0.0)})
    legs = [(f"{side}_knee", f"{side}_ankle") for side in ("left", "right")]
    assert cross(*(part(avatar, poses[0], leg) for leg in legs))
    cleared = kept(Legs(avatar), avatar, poses, np.array([[0.0, 1.0]]))
    assert not cross(*(part(avatar, cleared[0], leg) for leg in legs))
    left = [j for j, name in enumerate(avatar.joint_names) if name.startswith("left")]
    np.testing.assert_array_equal(cleared[:, left], poses[:, left])
    np.testing.assert_array_equal(kept(Legs(avatar), avatar, poses, np.zeros((1, 2))), poses)


def test_a_hand_that_passes_through_the_hips_goes_around_in_every_frame_without_a_jerk():
    avatar, frames = template(1.0), 60
    poses = turned(avatar, {"left_shoulder": (0.0, 0.0, -1.0), "right_shoulder": (0.0, 0.0, 1.0)}, frames)
    shoulder = avatar.joint_names.index("left_shoulder")
    poses[:, shoulder, 0] = np.linspace(-0.5, 0.6, frames)  # from ahead, through the hip, to behind
    hand, hips = ("left_wrist",), ("pelvis", "spine", "left_hip")
    root = np.tile(avatar.joints[0], (frames, 1))
    assert sum(cross(part(avatar, pose, hand), part(avatar, pose, hips)) for pose in poses[::4]) > 3
    cleared = kept(Arms(avatar), avatar, poses, np.ones((frames, 2)))
    assert not any(cross(part(avatar, pose, hand), part(avatar, pose, hips)) for pose in cleared[::2])
    assert spikes(posed_joints(avatar, cleared, root)[1], FRAME_TIME) == 0


def test_no_part_of_a_hand_is_far_from_what_is_looked_at():
    avatar = template(0.0)
    for side, looked_at in zip(("left", "right"), Arms(avatar).parts, strict=True):
        hand = avatar.weights[:, avatar.joint_names.index(f"{side}_wrist")] >= 0.95
        away, _ = cKDTree(avatar.bind_vertices[looked_at.places]).query(avatar.bind_vertices[hand])
        assert away.max() < 0.03  # a finger is half as thick, and its room is half of that


def test_a_place_beside_a_surface_is_as_high_above_it_as_it_is():
    """Over a level grid: that it lies in no common box with the place, and another one far away, change nothing."""
    x, z = (part.ravel() for part in np.meshgrid(*2 * [np.arange(-0.3, 0.31, 0.05)]))
    level = np.column_stack([x, 0.0 * x, z])
    far = level + np.array([0.0, 1.0, 0.0])
    body = np.concatenate([level, far])[None]
    normals = np.broadcast_to([0.0, 1.0, 0.0], body.shape)
    height, away = _heights(np.array([[[0.01, 0.05, 0.02], [0.01, 0.3, 0.02]]]), body, normals)
    np.testing.assert_allclose(height, [[0.05, np.inf]], rtol=1e-9)
    np.testing.assert_allclose(away[0, 0], [0.0, 1.0, 0.0], rtol=0, atol=1e-12)


def test_two_legs_that_are_free_go_half_the_way_each():
    free = np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.5, 0.5]])
    np.testing.assert_array_equal(_halves(free), [[0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.5, 0.5]])
