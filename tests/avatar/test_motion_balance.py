"""Hips that move aside: the cart on a table in closed form, and bodies that stand on a foot."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.motion.balance import balance, part_masses, zero_moment_point
from vto_pipeline.avatar.motion.figures import spikes
from vto_pipeline.avatar.motion.hips_aside import balanced, bounded, cart_stiffness, cart_way
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.io.motion.read import read_motion
from vto_pipeline.units import GRAVITY

DT = 1 / 30


@pytest.mark.parametrize("hertz", [0.3, 1.0])
def test_the_way_of_a_swaying_cart(hertz):
    """d - d'' / k = cos ωt has d = cos ωt / (1 + ω² / k)."""
    dt, stiffness, omega = 1 / 240, 10.0, 2 * np.pi * hertz
    t = np.arange(2400) * dt
    wanted = np.stack([np.cos(omega * t), np.sin(omega * t)], axis=1)
    inner = slice(600, -600)  # what ends at rest is felt for √(1/k) = 0.3 s
    found = cart_way(wanted, stiffness, dt)[inner]
    np.testing.assert_allclose(found, wanted[inner] / (1 + omega**2 / stiffness), rtol=0, atol=5e-3)


def test_the_way_is_the_mean_of_what_was_and_will_be():
    """Of a blow in one frame: √k / 2 exp(-√k |t|) dt."""
    dt, stiffness = 1 / 500, 10.0
    wanted = np.zeros((4001, 1))
    wanted[2000] = 1.0
    t = (np.arange(4001) - 2000) * dt
    truth = 0.5 * np.sqrt(stiffness) * np.exp(-np.sqrt(stiffness) * abs(t)) * dt
    np.testing.assert_allclose(cart_way(wanted, stiffness, dt)[:, 0], truth, rtol=0, atol=2e-3 * truth.max())


def test_a_mass_that_goes_that_way_has_the_zero_moment_point_that_was_wanted():
    height, t = 0.95, np.arange(400) * DT
    wanted = 0.05 * np.stack([np.sin(3 * t) + np.sin(5 * t), np.cos(4 * t)], axis=1)
    way = cart_way(wanted, GRAVITY / height, DT)
    mass = np.stack([way[:, 0], np.full(len(t), height), way[:, 1]], axis=1)[:, None]
    found = zero_moment_point(mass, np.ones(1), DT)[60:-60]
    np.testing.assert_allclose(found, wanted[60:-60], rtol=0, atol=3e-3)  # the filter, and differences of differences


def test_ways_are_bounded_and_short_ones_stay():
    turns = np.linspace(0.0, 2 * np.pi, 50)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    for length in (0.0, 0.004, 0.05, 3.0):
        found = bounded(length * around, 0.05)
        sizes = np.linalg.norm(found, axis=1)
        assert (sizes <= min(length, 0.05) + 1e-12).all()
        np.testing.assert_allclose(found, sizes[:, None] * around, rtol=0, atol=1e-12)
        if length < 0.005:
            np.testing.assert_allclose(found, length * around, rtol=0, atol=1e-5)


def on_one_foot(frames=60):
    """The mean body on its right foot, the left thigh and shank drawn up, its weight where it is on both feet."""
    body = template(0.5)
    poses = np.zeros((frames, len(body.joints), 3))
    poses[:, body.joint_names.index("left_hip"), 0] = -0.9
    poses[:, body.joint_names.index("left_knee"), 0] = 1.6
    for joint, back in (("right_hip", -0.25), ("right_knee", 0.5), ("right_ankle", -0.25)):  # a knee with room to give
        poses[:, body.joint_names.index(joint), 0] = back
    root = np.tile(body.joints[0], (frames, 1))
    sole = pose_avatar(body, poses[0], np.zeros(3)).vertices[:, 1].min()
    return body, poses, root - [0.0, sole, 0.0]


def centre_of_volume(body, poses, root):
    """By the divergence theorem, over the skin."""
    posed = pose_avatar(body, poses, root - body.joints[0])
    a, b, c = np.moveaxis(posed.vertices[body.faces], 1, 0)
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    return posed, (six[:, None] * (a + b + c) / 4).sum(axis=0) / six.sum()


def test_who_stands_on_a_foot_gets_the_weight_over_it():
    body, poses, root = on_one_foot()
    turn, place = posed_joints(body, poses, root)
    assert balance(turn, place, body, DT).inside_share == 0.0
    moved, aside = balanced(body, poses, root, DT, 0.3)
    after, there = posed_joints(body, moved, aside)
    assert balance(after, there, body, DT).inside_share == 1.0
    for side in ("left", "right"):
        ankle = body.joint_names.index(f"{side}_ankle")
        np.testing.assert_allclose(there[:, ankle], place[:, ankle], rtol=0, atol=1e-9)
        np.testing.assert_allclose(after[:, ankle], turn[:, ankle], rtol=0, atol=1e-9)
    posed, centre = centre_of_volume(body, moved[30], aside[30])
    sole = posed.vertices[posed.vertices[:, 1] < 0.02]
    assert (sole[:, [0, 2]].min(axis=0) - 0.01 < centre[[0, 2]]).all()
    assert (centre[[0, 2]] < sole[:, [0, 2]].max(axis=0) + 0.01).all()
    before = centre_of_volume(body, poses[30], root[30])[1]
    assert not sole[:, 0].min() - 0.01 < before[0] < sole[:, 0].max() + 0.01
    above = [body.joint_names.index(name) for name in ("spine", "neck", "left_elbow")]
    np.testing.assert_allclose(after[:, above], turn[:, above], rtol=0, atol=1e-9)  # the trunk goes along, upright


def test_the_cart_is_as_high_as_the_middle_of_the_body():
    body, poses, root = on_one_foot(3)
    stiffness = cart_stiffness(*posed_joints(body, poses, root), body, part_masses(body))
    _, centre = centre_of_volume(body, poses[0], root[0])
    assert GRAVITY / stiffness == pytest.approx(centre[1], abs=0.02)  # points of mass, drawn


def test_hips_go_no_farther_than_they_may():
    body, poses, root = on_one_foot()
    for within in (0.02, 0.05):
        _, aside = balanced(body, poses, root, DT, within)
        assert np.linalg.norm((aside - root)[:, [0, 2]], axis=1).max() < within
    same, still = balanced(body, poses, root, DT, 0.02)  # too little for any frame: as it was
    assert same is poses
    assert still is root


def test_nothing_is_done_in_the_air_or_where_all_is_well():
    body, poses, root = on_one_foot()
    assert balanced(body, poses, root + np.array([0.0, 1.0, 0.0]), DT, 0.1)[0] is poses
    stands = 0.0 * poses
    assert balanced(body, stands, np.tile(body.joints[0], (len(poses), 1)), DT, 0.1)[0] is stands


def test_a_walk_is_balanced_on_feet_that_stand_and_without_a_jerk():
    read, body = read_motion("walking_step"), template(1.0)
    plain, was = retarget(read.clip, read.joints, body)
    motion, figures = retarget(read.clip, read.joints, body, RetargetConfig(hips_aside_mm=60.0))
    assert was.balance.inside_share < figures.balance.inside_share
    assert figures.drift_after < 1e-6
    assert figures.spikes_after <= was.spikes_after
    assert figures.below_floor < 1e-3
    ankle = body.joint_names.index("left_ankle")
    little, _ = retarget(read.clip, read.joints, body, RetargetConfig(hips_aside_mm=10.0))
    hips = np.linalg.norm((little.translations - plain.translations)[:, [0, 2]], axis=1)
    assert 0.005 < hips.max() < 0.0105  # held feet lower them, straight down
    _, places = posed_joints(body, plain.poses, plain.translations + body.joints[0])
    _, after = posed_joints(body, motion.poses, motion.translations + body.joints[0])
    np.testing.assert_allclose(after[:, ankle], places[:, ankle], rtol=0, atol=5e-3)
    assert spikes(after, motion.frame_time) == figures.spikes_after


def test_it_is_off_unless_asked_for():
    read, body = read_motion("walking_step"), template(1.0)
    plain, _ = retarget(read.clip, read.joints, body, RetargetConfig())
    again, _ = retarget(read.clip, read.joints, body, RetargetConfig(hips_aside_mm=0.0))
    np.testing.assert_array_equal(plain.poses, again.poses)
    with pytest.raises(ValidationError):
        RetargetConfig(hips_aside_mm=-1.0)
