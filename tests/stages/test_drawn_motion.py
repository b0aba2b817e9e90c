"""A run's garment in motion, as it is drawn."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
import pytest
import trimesh
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.template.template import template
from vto_pipeline.cli.main import main
from vto_pipeline.errors import InputError
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.motion import AvatarMotion, ClothMotion
from vto_pipeline.stages.entry.moving import moving_scene
from vto_pipeline.stages.entry.outcome import open_run
from vto_pipeline.stages.entry.planning import catalogue

TURN, SHIFT = Rotation.from_rotvec([0.1, 0.7, -0.2]).as_matrix(), np.array([0.3, 0.1, -0.4])
MIDDLE = np.array([0.0, 1.0, 0.0])
FRAME_TIME = 0.04


def sphere(levels: int) -> TriangleMesh:
    mesh = trimesh.creation.icosphere(levels, 0.3)
    return TriangleMesh(mesh.vertices + MIDDLE, mesh.faces)


def motion() -> AvatarMotion:
    """The whole body turns, and steps to its left."""
    names = template(0.0).joint_names
    poses = np.zeros((2, len(names), 3))
    poses[1, 0] = [0.0, 0.5, 0.0]
    places = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    return AvatarMotion(names, poses, places, np.zeros((2, 4), bool), FRAME_TIME)


@pytest.fixture
def run(tmp_path) -> Path:
    """A run whose cloth is turned and shifted as one piece."""
    draped, tables, folder = sphere(3), catalogue(), tmp_path / "run"
    frames = np.stack([draped.vertices, draped.vertices @ TURN.T + SHIFT])
    made = {"draped": draped, "avatar": template(0.0), "avatar_motion": motion()}
    made["draped_motion"] = ClothMotion(frames, draped.faces, FRAME_TIME)
    (folder / "out").mkdir(parents=True)
    for name, value in made.items():
        kind = tables.kind(name)
        kind.write(folder / "out" / kind.filename, value)
    (folder / "run.json").write_text(json.dumps({"stages": [], "wanted": list(made)}))
    return folder


def goes_along(found: np.ndarray, draped: TriangleMesh, body: TriangleMesh, tolerance: float) -> None:
    """It is where the motion has it, but for what an arm is in or cuts, which is at the arm's skin or just above it."""
    wanted = draped.vertices @ TURN.T + SHIFT
    judge = o3d.t.geometry.RaycastingScene()
    judge.add_triangles(body.vertices.astype(np.float32), body.faces.astype(np.uint32))
    before, after = (judge.compute_signed_distance(x.astype(np.float32), nsamples=5).numpy() for x in (wanted, found))
    raised, clear = 9e-3, before > 1e-3  # m: corners of triangles that an arm cuts, at most
    assert_allclose(found[before > raised], wanted[before > raised], rtol=0, atol=tolerance)
    moved = np.linalg.norm(found - wanted, axis=1) > tolerance
    assert (moved & clear).sum() < 0.01 * len(wanted)
    assert 0 < (before < 0).sum() < 0.1 * len(wanted)
    assert after.min() > 0
    assert after[moved].max() < raised


def test_garment_and_body_are_where_the_motion_has_them(run):
    scene = moving_scene(open_run(run))
    assert (len(scene), scene.frames_per_second) == (2, pytest.approx(25.0))
    cloth, body = scene.at(1)
    goes_along(cloth.vertices, sphere(3), body, 1e-6)
    there = motion()
    posed = pose_avatar(template(0.0), there.poses[1], there.translations[1])
    assert_allclose(body.vertices, posed.vertices, rtol=0, atol=1e-6)
    low, high = scene.bounds()
    everything = np.vstack([mesh.vertices for frame in range(2) for mesh in scene.at(frame)])
    assert_allclose([low, high], [everything.min(axis=0), everything.max(axis=0)], rtol=0, atol=1e-6)


def test_the_detailed_garment_goes_along(run):
    from vto_pipeline.model.render import GlbPart

    fine, kind = sphere(5), catalogue().kind("render_mesh")
    kind.write(run / "out" / kind.filename, (GlbPart("garment", fine), GlbPart("body", sphere(1))))
    moved, body = moving_scene(open_run(run)).at(1)
    assert len(moved.vertices) == len(fine.vertices)
    goes_along(moved.vertices, fine, body, 1e-4)


@pytest.mark.parametrize("name", ["walk.mp4", "walk.gif"])
def test_the_motion_is_drawn_at_its_own_pace(run, name):
    path = run.parent / name
    assert main(["render", str(run), "--views", "", "--size", "96", "--motion", str(path)]) == 0
    video = cv2.VideoCapture(str(path))
    frames = [frame for ok, frame in iter(video.read, (False, None)) if ok]
    assert len(frames) == 2
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(25.0, rel=0.01)
    ink = [(frame < 240).any(axis=2) for frame in frames]
    assert min(one.mean() for one in ink) > 0.02
    assert (ink[0] != ink[1]).mean() > 0.01


def test_a_run_without_a_motion_is_refused(run):
    (run / "out/draped_motion.npz").unlink()
    with pytest.raises(InputError, match="no garment in motion") as caught:
        moving_scene(open_run(run))
    assert "--motion" in caught.value.hint
