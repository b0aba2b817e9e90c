"""Joints that a camera follows: a skeleton whose joints are there, on motions whose turns are known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from motion_shapes import NAMES as PERSON
from motion_shapes import OFFSETS, Moves, random_moves, tracked_places, tracked_text
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.motion.retarget import RetargetConfig, retarget
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import FormatError
from vto_pipeline.io.motion.read import MotionFile, read_motion
from vto_pipeline.io.motion.tracked.lines import LANDMARKS
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.kinematics import quaternion_matrices, vector_matrices, world_transforms

LEGS = ("hip", "knee", "ankle")
LIMBS = (("hip", "knee"), ("knee", "ankle"), ("ankle", "toe"), ("shoulder", "elbow"), ("elbow", "wrist"))


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def posed(read: MotionFile) -> tuple[np.ndarray, np.ndarray]:
    """World rotations and places of the clip's joints."""
    clip = read.clip
    return world_transforms(clip.parents, quaternion_matrices(clip.rotations), clip.translations)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.parametrize("size", [1.0, 1.15])
def test_legs_are_where_they_were_seen_and_arms_point_there(tmp_path, size):
    moves = random_moves(12)
    truth = {name: size * place for name, place in tracked_places(moves).items()}
    read = read_motion(written(tmp_path / "a.jsonl", tracked_text(moves, size=size)))
    _, places = posed(read)
    index = read.joints.indices
    assert read.clip.frame_time == pytest.approx(0.04)
    for side in ("left", "right"):
        for joint in LEGS:
            assert_allclose(places[:, index[f"{side}_{joint}"]], truth[f"{side}_{joint}"], rtol=0, atol=1e-9)
        for one, other in LIMBS:
            one, other = f"{side}_{one}", f"{side}_{other}"
            found = unit(places[:, index[other]] - places[:, index[one]])
            assert_allclose(found, unit(truth[other] - truth[one]), rtol=0, atol=1e-9)


def test_a_bent_knee_and_elbow_show_the_turn_about_their_bones(tmp_path):
    """Only hinges bend below hip and shoulder: then the bones' own rotations are known."""
    rng = np.random.default_rng(5)
    moves = random_moves(8)
    turns = moves.turns.copy()
    for side, way in (("Left", -1.0), ("Right", 1.0)):
        bends = rng.uniform(0.6, 1.5, (2, len(turns)))
        turns[:, PERSON.index(f"{side}Leg")] = Rotation.from_rotvec(np.outer(bends[0], [1, 0, 0])).as_matrix()
        turns[:, PERSON.index(f"{side}ForeArm")] = Rotation.from_rotvec(np.outer(way * bends[1], [0, 1, 0])).as_matrix()
    moves = Moves(turns, moves.root)
    read = read_motion(written(tmp_path / "a.jsonl", tracked_text(moves)))
    found, _ = posed(read)
    world, _ = world_transforms([-1 if k is None else k for k in _parents()], turns, OFFSETS)
    for side, own in (("Left", "left"), ("Right", "right")):
        for bone, child, joint, hinge in (
            ("UpLeg", "Leg", "hip", (1, 0, 0)),
            ("Arm", "ForeArm", "shoulder", (0, 1, 0)),
        ):
            turn = world[:, PERSON.index(f"{side}{bone}")]
            along = unit(turn @ OFFSETS[PERSON.index(f"{side}{child}")])
            got = found[:, read.joints.indices[f"{own}_{joint}"]] @ hinge
            assert_allclose(across(got, along), across(turn @ hinge, along), rtol=0, atol=1e-9)


def across(vectors: np.ndarray, along: np.ndarray) -> np.ndarray:
    """What of unit vectors is across others, unit."""
    return unit(vectors - along * (vectors * along).sum(axis=1, keepdims=True))


def _parents() -> list[int]:
    from motion_shapes import PARENTS

    return PARENTS


def walker(frames: int = 200, step_m: float = 0.5) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Someone who takes four steps ahead: each foot stands still while the other swings; and the way of the hips."""
    phase = np.linspace(0.0, 4.0, frames, endpoint=False)
    way = np.stack([0 * phase, 0.9 + 0.02 * np.cos(2 * np.pi * phase), step_m * phase], axis=1)
    places = {}
    for k, side in ((1, "left"), (-1, "right")):
        turn = phase + (0.0 if k > 0 else 1.0)  # a swing in every second step
        swing = np.where(turn % 2 < 1, turn % 1, 0.0)
        done = 2 * step_m * (np.floor(turn / 2) + np.where(turn % 2 < 1, swing, 1.0)) - (0.0 if k > 0 else step_m)
        lift = 0.1 * np.sin(np.pi * swing)
        ankle = np.stack([0.1 * k + 0 * phase, 0.08 + lift, done - 0.5 * step_m], axis=1)
        hip = np.add(way, [0.1 * k, 0, 0])
        places |= {f"{side}_hip": hip, f"{side}_ankle": ankle, f"{side}_toe": np.add(ankle, [0, -0.05, 0.15])}
        places[f"{side}_knee"] = 0.5 * (hip + ankle) + [0, 0, 0.05]
        for joint, (x, y, z) in (("shoulder", (0.2, 0.5, 0)), ("elbow", (0.25, 0.22, 0)), ("wrist", (0.25, 0, 0.1))):
            places[f"{side}_{joint}"] = np.add(way, [x * k, y, z])
    return places, way


def landmarks(places: dict[str, np.ndarray], axes: np.ndarray) -> list[list[list[float]]]:
    """MediaPipe's layout: about the middle of the hips, in a camera's axes, with visibility."""
    middle = 0.5 * (places["left_hip"] + places["right_hip"])
    frames = []
    for t in range(len(middle)):
        marks = np.zeros((33, 4))
        for name, k in LANDMARKS.items():
            if name in places:
                marks[k] = [*(axes @ (places[name][t] - middle[t])), 0.9]
        frames.append(marks.tolist())
    return frames


def test_landmarks_about_the_hips_walk_as_far_as_the_feet_do(tmp_path):
    places, way = walker()
    camera = np.diag([1.0, -1.0, -1.0])  # x to its right, y down, z away
    lines = [
        json.dumps({"timestamp_ms": 20 * t, "world_landmarks": marks})
        for t, marks in enumerate(landmarks(places, camera))
    ]
    job = Job()
    read = read_motion(written(tmp_path / "a.jsonl", "\n".join(lines)), job=job)
    assert read.axes.up == "-Y"
    assert read.clip.frame_time == pytest.approx(0.02)
    assert any("the foot that stands carries the body" in text for text in job.notes)
    _, found = posed(read)
    gone = 0.5 * (found[:, read.joints.indices["left_hip"]] + found[:, read.joints.indices["right_hip"]])
    assert way[-1, 2] - way[0, 2] > 1.9
    assert_allclose(gone - gone[0], way - way[0], rtol=0, atol=0.03)  # a frame's way is lost as each foot takes over


def test_the_avatar_moves_as_from_the_skeleton_itself(tmp_path):
    """The package's own step: bones point alike; how spine and shoulder blades share a bow, places do not tell."""
    step = read_motion("walking_step")
    _, there = posed(step)
    named = {name: there[:, k] for name, k in step.joints.indices.items() if name in LANDMARKS}
    lines = [
        json.dumps({"time_s": t * step.clip.frame_time, "joints": {k: v[t].tolist() for k, v in named.items()}})
        for t in range(len(there))
    ]
    read = read_motion(written(tmp_path / "a.jsonl", "\n".join(lines)))
    body = template(0.0)
    offsets = body.joints - np.where(body.parents[:, None] >= 0, body.joints[body.parents], 0)

    def places(read: MotionFile) -> np.ndarray:
        moved, _ = retarget(read.clip, read.joints, body, RetargetConfig(), Job())
        _, found = world_transforms(body.parents, vector_matrices(moved.poses), offsets)
        return found + moved.translations[:, None]

    one, other = places(step), places(read)
    bones = [k for k, name in enumerate(body.joint_names) if name.endswith(("knee", "ankle", "elbow", "wrist"))]
    above = body.parents[bones]
    cosine = (unit(one[:, bones] - one[:, above]) * unit(other[:, bones] - other[:, above])).sum(axis=-1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 8.0
    assert np.linalg.norm(one - other, axis=2).max() < 0.08


def test_joints_that_are_lost_for_a_while_lie_between(tmp_path):
    moves = random_moves(5)
    still = Moves(np.repeat(moves.turns[:1], 9, axis=0), np.linspace([0, 1, 0], [0.8, 1, 0], 9))
    lines = tracked_text(still).splitlines()
    for t in (3, 4):
        record = json.loads(lines[t])
        record["joints"]["left_knee"] = None
        record["joints"]["right_wrist"] = {"x": 0, "y": 0, "z": 0, "visibility": 0.2}
        lines[t] = json.dumps(record)
    job = Job()
    read = read_motion(written(tmp_path / "a.jsonl", "\n\n".join(lines)), job=job)
    assert any("left_knee, right_wrist" in text for text in job.warnings)
    _, places = posed(read)
    knee = places[:, read.joints.indices["left_knee"]]
    assert_allclose(np.diff(knee, axis=0), np.tile([0.1, 0, 0], (8, 1)), atol=1e-9)


def test_uneven_times_become_even(tmp_path):
    moves = random_moves(5)
    still = Moves(np.repeat(moves.turns[:1], 5, axis=0), np.array([[x, 1, 0] for x in (0, 0.1, 0.2, 0.4, 0.5)]))
    lines = tracked_text(still).splitlines()
    records = [json.loads(line) | {"time_s": time} for line, time in zip(lines, (0, 0.1, 0.2, 0.4, 0.5), strict=True)]
    read = read_motion(written(tmp_path / "a.jsonl", "\n".join(map(json.dumps, records))))
    assert len(read.clip.rotations) == 6
    _, places = posed(read)
    assert_allclose(np.diff(places[:, 0], axis=0), np.tile([0.1, 0, 0], (5, 1)), atol=1e-9)


def test_names_of_other_conventions_are_known(tmp_path):
    renamed = tracked_text(random_moves(3), None)
    for side in ("left", "right"):
        for ours, theirs in (
            ("shoulder", "Shoulder"),
            ("elbow", "Elbow"),
            ("wrist", "Wrist"),
            ("hip", "Hip"),
            ("knee", "Knee"),
            ("ankle", "Ankle"),
            ("toe", "Toe"),
        ):
            renamed = renamed.replace(f"{side}_{ours}", f"{side.capitalize()}{theirs}")
    job = Job()
    read = read_motion(written(tmp_path / "a.jsonl", renamed), job=job)
    assert {f"{side}_{joint}" for side in ("left", "right") for joint in LEGS} <= set(read.joints.indices)
    assert any("no time" in text for text in job.notes)


ONE = json.loads(tracked_text(random_moves(1)))


def without(joint: str) -> str:
    return json.dumps({"joints": {name: place for name, place in ONE["joints"].items() if name != joint}})


def in_one_place(one: str, other: str) -> str:
    return json.dumps({"joints": {**ONE["joints"], one: ONE["joints"][other]}})


def test_bytes_that_are_no_text_are_refused_with_the_line(tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_bytes(b"\xef\xbb\xbf" + tracked_text(random_moves(1)).encode() + b"\xff{}\n")
    with pytest.raises(FormatError, match="not a line of JSON") as caught:
        read_motion(path)
    assert "line 2" in caught.value.where


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("\n\n", "no frames"),
        ("\n{]\n", "line 2"),
        ("[1, 2]", "not an object"),
        ('{"time_s": 1}', "without joints"),
        ('{"world_landmarks": [[0, 0, 0]]}', "1 landmarks; expected 33"),
        ('{"joints": {"left_hip": [1, 2]}}', "not a place of three numbers"),
        ('{"joints": {"left_hip": [1, true, 2]}}', "not a place of three numbers"),
        (without("left_knee"), "no left_knee in any frame"),
        (in_one_place("left_knee", "left_hip"), "in one place"),
        (in_one_place("left_hip", "right_hip"), "in one place"),
        ("\n".join([json.dumps(ONE)] * 2), "do not rise, at frame 2"),
        ("\n".join([json.dumps(ONE), json.dumps({"joints": ONE["joints"]})]), "1 of 2 frames say when"),
        ("\n".join([json.dumps({"joints": ONE["joints"]}), *[without("left_knee")] * 3]), "left_knee is seen in 25%"),
    ],
)
def test_what_is_broken_is_refused(tmp_path, text, said):
    with pytest.raises(FormatError, match=said):
        read_motion(written(tmp_path / "a.jsonl", text))
