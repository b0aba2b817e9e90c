"""Jerks that are smoothed away: a slip of known size and time, missing frames, feet that stand meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

from vto_pipeline.avatar.motion.calm import calm, calm_on_held_feet
from vto_pipeline.avatar.motion.foot_skate import hold_feet
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.soles import contact_places
from vto_pipeline.avatar.template.template import template

RATE = 120
FRAMES = 240
SLIP = 100


def swinging() -> tuple[np.ndarray, np.ndarray]:
    """A body whose legs and one elbow swing evenly, and that goes ahead by 1 m/s."""
    body, t = template(0.5), np.arange(FRAMES) / RATE
    poses = np.zeros((FRAMES, len(body.joints), 3))
    for joint, axis, size in (("left_hip", 0, 0.4), ("right_hip", 0, -0.4), ("left_elbow", 1, 0.3)):
        poses[:, body.joint_names.index(joint), axis] = size * np.sin(2 * np.pi * t)
    return poses, body.joints[0] + t[:, None] * [0.0, 0.0, 1.0]


def jerks(places: np.ndarray) -> int:
    """Accelerations of 40 m/s² and 8 times the median of 0.2 s on either side, counted one by one."""
    found = 0
    for joint in range(places.shape[1]):
        size = np.linalg.norm(places[2:, joint] - 2 * places[1:-1, joint] + places[:-2, joint], axis=1) * RATE**2
        for k, one in enumerate(size):
            around = size[max(k - RATE // 5, 0) : k + RATE // 5 + 1]
            found += one > 40.0 and one > 8.0 * np.median(around)
    return found


def test_what_is_not_jerked_stays_bit_for_bit():
    poses, root = swinging()
    calmed, moved = calm(template(0.5), poses, root, 1 / RATE)
    np.testing.assert_array_equal(calmed, poses)
    np.testing.assert_array_equal(moved, root)


@pytest.mark.parametrize("frames", [1, 2])
def test_a_knee_that_slips_comes_back_to_its_course(frames):
    body, (poses, root) = template(0.5), swinging()
    slipped = poses.copy()
    slipped[SLIP : SLIP + frames, body.joint_names.index("left_hip"), 0] += 0.1
    truth, there = (posed_joints(body, some, root)[1] for some in (poses, slipped))
    calmed, moved = calm(body, slipped, root, 1 / RATE)
    here = posed_joints(body, calmed, moved)[1]
    assert jerks(truth) == 0
    assert jerks(there) > 0
    assert jerks(here) == 0
    knee = body.joint_names.index("left_knee")
    off = [np.linalg.norm(places[:, knee] - truth[:, knee], axis=1).max() for places in (there, here)]
    assert off[1] < 0.5 * off[0]
    far = abs(np.arange(FRAMES) - SLIP) > RATE // 4
    np.testing.assert_allclose(here[far], there[far], rtol=0, atol=1e-9)  # as it came


@pytest.mark.parametrize("at", [15, SLIP, FRAMES - 15])
def test_missing_frames_are_passed_without_a_jerk_and_both_ends_stay(at):
    body, (poses, root) = template(0.5), swinging()
    root[at:, 2] += 0.1  # a tenth of a second is missing
    calmed, moved = calm(body, poses, root, 1 / RATE)
    assert jerks(posed_joints(body, poses, root)[1]) > 0
    assert jerks(posed_joints(body, calmed, moved)[1]) == 0
    assert (np.diff(moved[:, 2]) > 0.0).all()
    np.testing.assert_allclose(moved[[0, -1]], root[[0, -1]], rtol=0, atol=1e-12)


def standing(slip: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A body that stands on its feet and leans, whose trunk slips by so much for a frame; and what is planted."""
    body, t = template(0.5), np.arange(FRAMES) / RATE
    poses = np.zeros((FRAMES, len(body.joints), 3))
    root = body.joints[0] + np.stack([0.03 * np.sin(2 * np.pi * t), 0 * t - 0.03, 0 * t], axis=1)
    root[SLIP, 0] += slip
    return poses, root, np.ones((FRAMES, 4), dtype=bool)


def test_feet_stand_while_the_body_above_is_calmed():
    body, (poses, root, planted) = template(0.5), standing(0.01)
    calmed, moved, stand = calm_on_held_feet(body, poses, root, planted, 1 / RATE)
    turn, place = posed_joints(body, calmed, moved)
    contacts = contact_places(turn, place, body)
    assert stand.all()
    assert abs(contacts - contacts[0]).max() < 1e-9
    assert abs(contacts[..., 1]).max() < 1e-9
    assert jerks(place) == 0
    _, root = hold_feet(*posed_joints(body, poses, root), planted, body, 1 / RATE)
    assert abs(np.diff(root[:, 0], 2)).max() * RATE**2 > 40.0  # holding alone leaves it


def test_a_foot_that_could_only_leap_from_stand_to_stand_stands_for_less():
    body, (poses, root, planted) = template(0.5), standing(0.0)
    hip = body.joint_names.index("left_hip")
    poses[SLIP + 8 :, hip, 2] = 0.1  # the foot stands 8 cm farther out after 8 frames
    planted[SLIP : SLIP + 8, :2] = False
    calmed, moved, stand = calm_on_held_feet(body, poses, root, planted, 1 / RATE)
    turn, place = posed_joints(body, calmed, moved)
    contacts = contact_places(turn, place, body)
    assert jerks(place) == 0
    assert not (stand & ~planted).any()
    assert stand[: SLIP - RATE // 4].all()
    assert stand[SLIP + 8 + RATE // 4 :].all()
    for part in (slice(0, SLIP), slice(SLIP + 8, FRAMES)):
        for n in range(4):
            there = contacts[part, n][stand[part, n]]
            assert abs(there - there[0]).max() < 1e-9
