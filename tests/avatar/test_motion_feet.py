"""Legs in closed form, plants of known times, feet that are held, limits, timing and balance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.motion.balance import balance, part_masses, zero_moment_point
from vto_pipeline.avatar.motion.figures import plant_drift, spikes
from vto_pipeline.avatar.motion.foot_skate import fade_out, hold_feet
from vto_pipeline.avatar.motion.joint_places import posed_joints
from vto_pipeline.avatar.motion.leg_reach import lowering, two_bones
from vto_pipeline.avatar.motion.limits import limit_turns
from vto_pipeline.avatar.motion.plants import find_plants
from vto_pipeline.avatar.motion.soles import contact_places
from vto_pipeline.avatar.motion.timing import hold_last, lead_in, resample
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import InputError
from vto_pipeline.model.motion import AvatarMotion, Clip
from vto_pipeline.units import GRAVITY


def test_two_bones_reach_by_the_law_of_cosines():
    rng = np.random.default_rng(5)
    count, first, second = 200, 0.42, 0.39
    turns = Rotation.random(count, rng=rng).as_matrix()
    thigh, shank = first * turns[:, :, 0], second * Rotation.random(count, rng=rng).as_matrix()[:, :, 0]
    hip = rng.normal(size=(count, 3))
    way = rng.normal(size=(count, 3))
    way *= (rng.uniform(0.1, 0.99 * (first + second), count) / np.linalg.norm(way, axis=1))[:, None]
    turn, turn_below = two_bones(hip, hip + way, thigh, shank, turns[:, :, 1])
    new_thigh = np.einsum("tab,tb->ta", turn, thigh)
    new_shank = np.einsum("tab,tb->ta", turn_below, shank)
    np.testing.assert_allclose(hip + new_thigh + new_shank, hip + way, rtol=0, atol=1e-9)  # rounding
    distance = np.linalg.norm(way, axis=1)
    knee = np.arccos((first**2 + second**2 - distance**2) / (2 * first * second))
    bend = np.arccos(np.clip((new_thigh * new_shank).sum(axis=1) / (first * second), -1, 1))
    np.testing.assert_allclose(bend, np.pi - knee, rtol=0, atol=1e-6)  # of the arc cosine
    along = turns[:, :, 1] - (turns[:, :, 1] * way).sum(axis=1, keepdims=True) * way / distance[:, None] ** 2
    assert ((np.cross(new_thigh, new_shank) * along).sum(axis=1) > 0).all()  # the shank turns about the hinge


def test_what_is_out_of_reach_is_reached_for_straight():
    down = np.array([[0.0, -0.4, 0.0]])
    turn, below = two_bones(np.zeros((1, 3)), np.array([[2.0, 0.0, 0.0]]), down, down, np.array([[0.0, 0.0, 1.0]]))
    for one in (turn, below):
        np.testing.assert_allclose(one[0] @ down[0], [0.4, 0.0, 0.0], rtol=0, atol=1e-6)  # nearly straight


def test_a_point_is_planted_while_it_stands():
    dt = 1 / 100
    t = np.arange(300) * dt
    x = np.where(t < 1, 0.0, np.where(t < 2, t - 1.0, 1.0))  # stands, moves at 1 m/s, stands
    y = np.where((t > 1.3) & (t < 1.7), 0.1, 0.0)
    high = np.stack([x * 0.0, x * 0.0 + 0.2, x * 0.0], axis=1)
    places = np.stack([np.stack([x, y, 0 * x], axis=1), high], axis=1)
    planted = find_plants(places, dt)
    assert planted[:, 1].sum() == 0
    truth = (t < 1) | (t >= 2)
    assert (planted[:, 0] != truth).sum() <= 6  # speeds are taken over 0.03 s
    assert planted[2:95, 0].all()
    assert not planted[105:195, 0].any()


def joint_by_joint(body, turned, root):
    """Where the joints are, each by its parent, shape (T, J, 3)."""
    offsets = np.array([body.joints[j] - body.joints[max(p, 0)] for j, p in enumerate(body.parents)])
    places = np.empty((len(root), len(offsets), 3))
    for j, parent in enumerate(body.parents):
        places[:, j] = root if parent < 0 else places[:, parent] + turned[:, parent] @ offsets[j]
    return places


def standing(frames: int, root: np.ndarray, body=None):
    """Rotations and places of a body in the bind pose whose root moves."""
    body = body or template(0.5)
    return posed_joints(body, np.zeros((frames, len(body.joints), 3)), body.joints[0] + root), body


def test_sliding_feet_are_held_and_bones_keep_their_length():
    frames, dt = 120, 1 / 60
    slide = np.stack([0.1 * np.arange(frames) * dt, np.zeros(frames), np.zeros(frames)], axis=1)
    (turn, place), body = standing(frames, slide)
    before = contact_places(turn, place, body)
    planted = find_plants(before, dt)
    assert planted.all()
    assert plant_drift(before, planted) == pytest.approx(0.1 * (frames - 1) * dt / 2, rel=1e-6)
    turned, root = hold_feet(turn, place, planted, body, dt)
    places = joint_by_joint(body, turned, root)
    after = contact_places(turned, places, body)
    assert plant_drift(after, planted) < 1e-9
    assert abs(after[..., 1]).max() < 1e-9
    assert spikes(places, dt) == 0


def test_a_foot_that_comes_down_through_the_floor_slides_onto_it():
    """The left leg is lifted by its knee, and dips by 2 cm before it stands from frame 60 on."""
    frames, dt = 120, 1 / 60
    (turn, place), body = standing(frames, np.zeros((frames, 3)))
    left = [body.joint_names.index(f"left_{joint}") for joint in ("knee", "ankle")]
    away = np.clip((59 - np.arange(frames)) / 60, 0.0, 1.0)
    place[:, left[1], 1] += 0.3 * away * (away - 0.5)  # below the floor in the last half second
    planted = np.ones((frames, 4), dtype=bool)
    planted[:60, :2] = False
    sunk = contact_places(turn, place, body)
    assert sunk[..., 1].min() < -0.015
    turned, root = hold_feet(turn, place, planted, body, dt)
    places = joint_by_joint(body, turned, root)
    after = contact_places(turned, places, body)
    assert after[..., 1].min() > -1e-6  # a leg that is almost straight
    assert abs(after[60:] - after[60]).max() < 1e-9


def test_corrections_fade_without_a_jump_of_place_or_speed():
    values = np.linspace(0.1, 0.3, 60)[:, None] * [1.0, -2.0]
    known = np.zeros(60, dtype=bool)
    known[10:20] = known[32:40] = True
    faded = fade_out(values, known, 8)
    np.testing.assert_array_equal(faded[known], values[known])
    assert (faded[:2] == 0).all()
    assert (faded[48:] == 0).all()
    speed = np.diff(faded, axis=0)
    # a Hermite curve over 8 frames bends by at most 6 d + 4 v per frame squared, over 64
    assert abs(np.diff(speed, axis=0)).max() < (6 * 0.6 + 4 * 8 * 0.007) / 64


def test_a_correction_that_grows_keeps_its_speed_where_it_ends():
    known = np.arange(40) < 20
    faded = fade_out(np.minimum(np.arange(40) - 19.0, 0.0)[:, None] * 0.02, known, 8)
    assert abs(np.diff(faded[:, 0], 2)).max() < 0.011  # 4 v / 8; without it, the whole v of 0.02


def test_the_root_is_lowered_smoothly_and_enough():
    need = np.zeros(100)
    need[40:45] = 0.03
    drop = lowering(need, 10)
    assert (drop >= need - 1e-12).all()
    assert drop.max() <= 0.03 + 1e-12
    assert abs(np.diff(drop, 2)).max() < 0.03 * (np.pi / 11) ** 2


def test_joints_stay_within_their_limits_on_both_sides():
    names = ("left_knee", "right_knee", "left_hip", "right_hip", "pelvis")
    poses = np.zeros((2, 5, 3))
    poses[0, :2, 0] = -1.0  # knees bent backward
    poses[0, 2, 2], poses[0, 3, 2] = -1.5, 1.5  # both legs across the other
    poses[:, 4] = 3.0
    limited, changed = limit_turns(poses, names)
    np.testing.assert_allclose(np.rad2deg(limited[0, :2, 0]), -10.0, rtol=1e-12)
    np.testing.assert_allclose(np.rad2deg(limited[0, 2:4, 2]), [-45.0, 45.0], rtol=1e-12)
    np.testing.assert_array_equal(limited[:, 4], poses[:, 4])
    assert changed == dict.fromkeys(names[:4], 0.5)


def spinning_clip(rate: float, frames: int) -> Clip:
    """One joint that turns about y at a steady 90 degrees a second, and moves by 1 m/s."""
    t = np.arange(frames) / rate
    turns = Rotation.from_euler("Y", 90.0 * t[:, None], degrees=True).as_quat()[:, None]
    places = np.stack([t, 0 * t, 0 * t], axis=1)[:, None]
    still = np.array([[0.0, 0.0, 0.0, 1.0]])
    return Clip(("a",), np.array([-1]), np.zeros((1, 3)), still, turns, places, 1 / rate)


@pytest.mark.parametrize(("rate", "wanted"), [(240.0, 30.0), (10.0, 60.0), (120.0, 25.0)])
def test_another_rate_keeps_a_steady_motion(rate, wanted):
    clip = resample(spinning_clip(rate, int(3 * rate) + 1), wanted)
    assert len(clip.rotations) == int(3 * wanted) + 1
    truth = spinning_clip(wanted, len(clip.rotations))
    cosine = abs((clip.rotations * truth.rotations).sum(axis=-1))
    assert np.rad2deg(2 * np.arccos(np.minimum(cosine, 1.0))).max() < 0.01  # a cubic spline through a circle
    np.testing.assert_allclose(clip.translations, truth.translations, rtol=0, atol=1e-9)
    with pytest.raises(InputError, match="at most 200000"):
        resample(spinning_clip(1 / 9.0, 200), 240.0)


def test_a_lead_in_starts_from_the_pose_and_sets_out_from_the_first_frame():
    body = template(0.5)
    names = body.joint_names
    t = np.arange(40) / 30
    poses = np.zeros((40, len(names), 3))
    poses[:, 0, 1] = 1.2  # faces elsewhere
    poses[:, names.index("left_elbow"), 1] = -0.5 - 1.0 * t
    motion = AvatarMotion(names, poses, np.stack([5 + t, 0 * t, 0 * t], axis=1), np.ones((40, 4), dtype=bool), 1 / 30)
    led = lead_in(motion, body, 0.5)
    assert len(led.poses) == 15 + 12 + 28 + 12  # at an even gain of speed, 0.4 s bring it as far as else 0.2 s
    np.testing.assert_allclose(led.poses[0], body.pose, rtol=0, atol=1e-9)
    np.testing.assert_allclose(led.translations[0], body.translation, rtol=0, atol=1e-9)
    assert not led.planted[:15].any()
    assert led.planted[15:].all()
    elbow, slow = led.poses[:, names.index("left_elbow"), 1], np.arange(12)
    np.testing.assert_allclose(elbow[15:27], -0.5 - slow**2 / 24 / 30, rtol=0, atol=1e-9)
    np.testing.assert_allclose(elbow[27:55], poses[6:34, names.index("left_elbow"), 1], rtol=0, atol=1e-9)
    assert abs(np.diff(elbow, 2)).max() < 0.014  # rad per frame squared: 6 x 0.5 / 15**2 of the lead-in's cubic
    # the motion goes where the body faces: it went to +x facing 1.2 rad, now it faces +z
    way = led.translations[-1] - led.translations[15]
    np.testing.assert_allclose(way, 39 / 30 * np.array([np.cos(-1.2), 0.0, -np.sin(-1.2)]), rtol=0, atol=1e-9)


@pytest.mark.parametrize("rate", [10, 30, 240])
def test_a_motion_that_is_fast_at_both_ends_never_swings_beyond_its_poses(rate):
    body = template(0.5)
    knee = body.joint_names.index("right_knee")
    t = np.arange(rate) / rate
    poses = np.zeros((rate, len(body.joint_names), 3))
    poses[:, knee, 0] = 0.4 + 10.0 * t  # rad: a runner's knee
    still = np.zeros((rate, 4), dtype=bool)
    along = np.stack([0 * t, 0 * t, 4.0 * t], axis=1)
    motion = AvatarMotion(body.joint_names, np.minimum(poses, 2.0), along, still, 1 / rate)
    whole = hold_last(lead_in(motion, body, 1.0), 0.5)
    assert (whole.poses[-round(rate / 2) :] == whole.poses[-1]).all()
    bend, gone = whole.poses[:, knee, 0], whole.translations[:, 2]
    assert bend.min() > -1e-9
    assert bend.max() < 2.0 + 1e-9
    assert (np.diff(bend[: rate + 1]) > -1e-9).all()
    assert (np.diff(gone) > -1e-9).all()
    pull = np.diff(np.concatenate([[gone[0]] * 2, gone]), 2) * rate**2
    assert abs(pull).max() < 1.5 * 4.0 / 0.4  # m/s²: from rest to 4 m/s in 0.4 s, and back


def test_a_motion_comes_to_rest_as_it_sets_out_and_a_pose_is_only_held():
    body = template(0.5)
    count, elbow = 40, body.joint_names.index("left_elbow")
    poses = np.zeros((count, len(body.joint_names), 3))
    poses[:, elbow, 1] = -np.arange(count) / 30
    planted = np.ones((count, 4), dtype=bool)
    planted[-3, 0] = False
    motion = AvatarMotion(body.joint_names, poses, np.zeros((count, 3)), planted, 1 / 30)
    led = lead_in(motion, body, 0.5)
    bend, lifted = led.poses[15:, elbow, 1], np.flatnonzero(~led.planted[15:, 0])
    np.testing.assert_allclose(bend[-1:-13:-1], bend[-1] + np.arange(12) ** 2 / 24 / 30, rtol=0, atol=1e-9)
    assert bend[-1] == pytest.approx(poses[-1, elbow, 1])
    near = np.arange(12) ** 2 / 24  # frames before the end; slowed, they are 0, 1, 2 ... before it
    np.testing.assert_array_equal(len(bend) - 1 - lifted[::-1], np.flatnonzero(abs(near - 2) < 1))
    one = AvatarMotion(body.joint_names, poses[:1], np.zeros((1, 3)), planted[:1], 1 / 30)
    assert len(hold_last(lead_in(one, body, 0.5), 0.2).poses) == 15 + 1 + 6


def test_the_zero_moment_point_of_a_swaying_mass():
    dt, height, sway, omega = 1 / 120, 0.9, 0.1, 2 * np.pi * 0.8
    t = np.arange(600) * dt
    parts = np.stack([sway * np.sin(omega * t), np.full_like(t, height), 0 * t], axis=1)[:, None]
    found = zero_moment_point(parts, np.ones(1), dt)
    truth = sway * np.sin(omega * t) * (1 + height * omega**2 / GRAVITY)
    inner = slice(60, -60)  # the filter knows nothing beyond the ends
    np.testing.assert_allclose(found[inner, 0], truth[inner], rtol=0, atol=0.01 * sway)  # filter and differences
    assert abs(found[inner, 1]).max() < 1e-12


def test_a_standing_body_is_balanced_and_a_leaning_one_is_not():
    (turn, place), body = standing(40, np.zeros((40, 3)))
    found = balance(turn, place, body, 1 / 30)
    assert found.inside_share == 1.0
    poses = np.zeros((40, len(body.joints), 3))
    poses[:, body.joint_names.index("spine"), 0] = 1.2  # bowed from the waist
    leaning = balance(*posed_joints(body, poses, np.tile(body.joints[0], (40, 1))), body, 1 / 30)
    assert (leaning.zero_moment[:, 1] > found.zero_moment[:, 1] + 0.05).all()
    aloft = balance(turn, place + np.array([0.0, 1.0, 0.0]), body, 1 / 30)
    assert aloft.inside_share is None


def test_masses_are_shares_of_the_volume():
    body = template(0.5)
    share, middle = part_masses(body)
    assert share.sum() == pytest.approx(1.0)
    names = body.joint_names
    # de Leva 1996: thighs hold 14 % each, forearms 1.5 %; our joints part them elsewhere, hence the wide bounds
    thighs = [share[names.index(f"{side}_hip")] for side in ("left", "right")]
    assert 0.07 < min(thighs) <= max(thighs) < 0.18
    assert thighs[0] == pytest.approx(thighs[1], rel=0.1)  # drawn points
    assert 0.85 < (share @ middle)[1] / 1.7 * 1.7 < 1.05  # at the height of the pelvis


def test_a_jerk_is_seen_and_a_step_is_not():
    dt = 1 / 100
    t = np.arange(200) * dt
    smooth = np.stack([np.sin(6 * t), 0 * t, 0 * t], axis=1)[:, None]
    assert spikes(smooth, dt) == 0
    jerked = smooth.copy()
    jerked[100] += 0.02
    assert 1 <= spikes(jerked, dt) <= 3


def test_places_of_joints_are_those_of_the_skin():
    body = template(0.5)
    poses = np.random.default_rng(6).uniform(-0.5, 0.5, (5, len(body.joints), 3))
    root = np.random.default_rng(7).uniform(-1, 1, (5, 3))
    turn, place = posed_joints(body, poses, body.joints[0] + root)
    for t in range(5):
        rotation, offset = joint_transforms(body.joints, body.parents, poses[t])
        truth = np.einsum("jab,jb->ja", rotation, body.joints) + offset + root[t]
        np.testing.assert_allclose(place[t], truth, rtol=0, atol=1e-12)
        np.testing.assert_allclose(turn[t], rotation, rtol=0, atol=1e-12)
