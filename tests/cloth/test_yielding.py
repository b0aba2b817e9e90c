"""Bodies that give way where their own parts press on each other."""

import numpy as np
import pytest
from cloth_scenes import ball
from ipc_judge import self_crosses

from vto_pipeline.avatar.model.pose import named_pose, pose_avatar
from vto_pipeline.avatar.template.template import template
from vto_pipeline.cloth.collision.body import yielding
from vto_pipeline.cloth.collision.body.yielding import YieldingBody, give_way, sunken
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import BodyPath

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


def test_on_a_path_there_is_room_for_cloth_that_lies_in_several_layers():
    near = two_balls([ROOM + 0.004, ROOM + 0.004, OVERLAPPING])  # no crease, though not room for a hem
    path = BodyPath(lambda time: near.keyframes[round(time)].copy(), near.faces, 3, 1.0)
    body = YieldingBody(path, SKIN, everywhere(near))
    assert [body.own_crossings(frame) > 0 for frame in range(3)] == [False, False, True]
    assert not any(body.crosses_itself(frame) for frame in range(3))
    for frame in range(3):
        assert 3.0 * ROOM - 1e-9 < gap_between(body.path.at(path.time(frame))) < 3.0 * ROOM + 0.01


def test_cloth_in_the_posed_skin_counts_where_that_was_free_and_only_there():
    """A small sheet through the face of one ball: it has room, until the other ball is there."""
    bodies = two_balls([APART, ROOM + 0.004, 0.5 * ROOM])
    path = BodyPath(lambda time: bodies.keyframes[round(time)].copy(), bodies.faces, 3, 1.0)
    body = YieldingBody(path, SKIN, everywhere(bodies))
    counted = []
    for frame, gap in enumerate([APART, ROOM + 0.004, 0.5 * ROOM]):
        at = -0.5 * gap + np.array([[-0.001, -0.005, 0.0], [0.001, 0.0, 0.005], [0.001, 0.0, -0.005]])[:, 0]
        sheet = TriangleMesh(np.column_stack([at, [-0.005, 0.0, 0.0], [0.0, 0.005, -0.005]]), np.array([[0, 1, 2]]))
        counted.append(len(body.crossing_with_room(sheet, frame)) > 0)
    assert counted == [False, True, False]  # not sunk; sunk though free; pressed


@pytest.mark.parametrize(("speed", "times"), [(0.1, 60), (0.0, 1)])
def test_each_frame_sinks_once_however_many_steps_and_attempts_lead_to_it(monkeypatch, speed, times):
    """Steps add up to the time of a frame but for rounding: it must not count as one between two others.

    A pose that is held sinks once for all frames.
    """
    sunk, sink = [], yielding._sink

    def counted(mesh, *others):
        sunk.append(mesh)
        return sink(mesh, *others)

    monkeypatch.setattr(yielding, "_sink", counted)
    balls, count = two_balls([APART]), 60
    way = np.array([speed, 0.0, 0.0])
    path = BodyPath(lambda time: balls.keyframes[0] + time * way, balls.faces, count, 1.0 / 30.0)
    body, time = YieldingBody(path, SKIN, everywhere(balls)), 0.0
    for frame in range(1, count):
        begin = time
        for steps in (2, 7, 16):  # of each attempt
            time = begin
            for _ in range(steps):
                step = (path.time(frame) - begin) / steps
                body.path.at(time)
                time += step
                body.path.at(time)
        body.path.at(path.time(frame))
        body.depth(frame)
    assert len(sunk) == times


@pytest.mark.parametrize("chosen", ["all", "none"])
def test_what_still_passes_through_itself_is_known_without_asking_again(chosen):
    """By ipctk: of a seated body whose skin has sunk, or was not to."""
    person = named_pose(template(0.5), "sitting")
    about = np.arange(len(person.vertices) if chosen == "all" else 0)
    path = BodyPath(lambda time: person.vertices if time else template(0.5).vertices, person.faces, 2, 1.0)
    body = YieldingBody(path, SKIN, about)
    assert body.own_crossings(1) > 0
    assert body.crosses_itself(1) == self_crosses(TriangleMesh(body.path.at(1.0), person.faces)) == (chosen == "none")


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_groins_that_turn_inside_out_are_smoothed_until_nothing_passes_through_anything(share):
    """By ipctk; sinking alone leaves the bottom of the fold as it is."""
    person = named_pose(template(share), "sitting")
    assert self_crosses(person)
    moved = sunken(TriangleMesh(person.vertices, person.faces), np.arange(len(person.vertices)), ROOM)
    assert not self_crosses(TriangleMesh(person.vertices + moved, person.faces))
    far = np.linalg.norm(moved, axis=1)
    assert 0.005 < far.max() < 0.045
    folds = [person.joint_names.index(f"{side}_{joint}") for side in ("left", "right") for joint in ("hip", "knee")]
    away = np.linalg.norm(person.bind_vertices[:, None] - person.joints[folds], axis=2).min(axis=1)
    assert away[far > 1e-3].max() < 0.3  # about hips and knees, nowhere else


@pytest.mark.parametrize(("share", "more"), [(0.5, 1.2), (1.0, 1.15)])
def test_a_deep_fold_is_smoothed_with_what_lies_about_it(share, more):
    """Thighs drawn up farther than in a seat; by ipctk. What is inside out there crosses nothing in parts."""
    seated = named_pose(template(share), "sitting")
    person = pose_avatar(seated, more * seated.pose, seated.translation)
    assert len(self_intersections(person.mesh)) > 200
    moved = sunken(person.mesh, np.arange(len(person.vertices)), ROOM)
    assert not self_crosses(TriangleMesh(person.vertices + moved, person.faces))
    assert np.linalg.norm(moved, axis=1).max() < 0.045
