"""Bodies that give way where their own parts press on each other."""

import numpy as np
from cloth_scenes import ball

from vto_pipeline.cloth.collision.body.yielding import give_way
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh

RADIUS, SKIN = 0.1, 0.003  # m
APART, OVERLAPPING = 0.05, -0.006  # m between two balls
ROOM = 2.0 * SKIN


def two_balls(gaps):
    """Two balls on the x axis, with these gaps between them from keyframe to keyframe [m]."""
    one = ball(RADIUS)
    frames = [
        np.concatenate([one.vertices + np.array([side * (RADIUS + 0.5 * gap), 0.0, 0.0]) for side in (-1, 1)])
        for gap in gaps
    ]
    return MovingBody(np.array(frames), np.concatenate([one.faces, one.faces + len(one.vertices)]))


def everywhere(body):
    return np.arange(body.keyframes.shape[1])


def gap_between(frame):
    half = len(frame) // 2
    return frame[half:, 0].min() - frame[:half, 0].max()


def test_what_passes_through_itself_on_its_way_leaves_room_for_cloth_on_either_side():
    given = two_balls([APART, OVERLAPPING, APART])
    assert len(self_intersections(TriangleMesh(given.keyframes[1], given.faces))) > 0
    found, deepest = give_way(given, SKIN, everywhere(given))
    assert ROOM <= gap_between(found.keyframes[1]) < ROOM + 0.01
    assert 0.5 * (ROOM - OVERLAPPING) <= deepest < 0.5 * (ROOM - OVERLAPPING) + 0.005
    moved = np.linalg.norm(found.keyframes[1] - given.keyframes[1], axis=1)
    assert (moved[np.abs(given.keyframes[1][:, 0]) > 0.7 * RADIUS] == 0.0).all()  # only about where they meet
    assert (found.keyframes[[0, 2]] == given.keyframes[[0, 2]]).all()


def test_both_sides_give_way_alike():
    given = two_balls([APART, OVERLAPPING, APART])
    left, right = np.split(give_way(given, SKIN, everywhere(given))[0].keyframes[1], 2)
    mirrored = left * (-1.0, 1.0, 1.0)
    nearest = np.linalg.norm(mirrored[:, None] - right[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-3


def test_where_a_motion_ends_the_body_is_as_it_was_given():
    given = two_balls([APART, 0.01, OVERLAPPING])
    found, deepest = give_way(given, SKIN, everywhere(given))
    assert deepest == 0.0
    assert found is given
    asked, deepest = give_way(given, SKIN, everywhere(given), at_end=True)
    assert deepest > 0.0
    assert gap_between(asked.keyframes[-1]) >= ROOM


def test_only_what_is_asked_about_gives_way_and_creases_of_the_first_keyframe_never_do():
    given = two_balls([APART, OVERLAPPING, APART])
    assert give_way(given, SKIN, np.arange(0))[1] == 0.0
    creased = two_balls([OVERLAPPING, 2.0 * OVERLAPPING, APART])
    assert give_way(creased, SKIN, everywhere(creased))[1] < give_way(given, SKIN, everywhere(given))[1]
