"""The fit in poses: how it is asked for, and what becomes of poses that are reached, refused or interrupted."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import ConfigError, IntersectingError
from vto_pipeline.geometry.topology import submesh, vertex_normals
from vto_pipeline.io.bodies.avatars import write_avatar
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages import poses
from vto_pipeline.stages.entry.documents import drape_order
from vto_pipeline.stages.entry.planning import catalogue, planned_document

SHIRT, COAT, BODY, AVATAR = map(Path, ("shirt.obj", "coat.obj", "body.ply", "avatar.npz"))


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_avatar(AVATAR, template(0.0))
    for path in (SHIRT, COAT, BODY):
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def order(garments, body, names):
    return drape_order(garments, ["denim"], body, None, None, False, "here", None, names)


def test_poses_come_after_the_drape_and_are_settings(files):
    found = planned_document(order([SHIRT], AVATAR, ["arms_up", "step"]).document, Path.cwd(), [], catalogue())[1]
    names = [step.stage.name for step in found.steps]
    assert names.index("drape") < names.index("poses")
    assert next(step.settings for step in found.steps if step.stage.name == "poses").poses == ("arms_up", "step")


@pytest.mark.parametrize(
    ("garments", "body", "names", "problem"),
    [
        ([SHIRT], BODY, ["arms_up"], "a pose needs a body with joints"),
        ([SHIRT, COAT], AVATAR, ["arms_up"], "a pose is only possible with one garment"),
        ([SHIRT], AVATAR, ["armsup"], r"poses\.poses"),
    ],
)
def test_what_cannot_be_posed_is_refused(files, garments, body, names, problem):
    with pytest.raises(ConfigError, match=problem):
        planned_document(order(garments, body, names).document, Path.cwd(), [], catalogue())


@pytest.fixture
def worn():
    """A sleeveless tube of the trunk, a centimetre off it."""
    person = template(0.5)
    own = np.array(person.joint_names)[person.weights.argmax(axis=1)]
    skin = TriangleMesh(person.vertices, person.faces)
    wider = TriangleMesh(skin.vertices + 0.01 * vertex_normals(skin), skin.faces)
    cloth = submesh(wider, np.isin(own, ("spine",))[skin.faces].all(axis=1))[0]
    rest = RestShape(cloth.vertices)
    return {
        "avatar": person,
        "draped": cloth,
        "garment": cloth,
        "sim_mesh": cloth,
        "worn_rest": rest,
        "fabric": read_fabric("cotton_poplin"),
    }


def riding(refused=(), asked=None):
    """A drape that carries the garment along rigidly with the pelvis; what really happens is the drape's own test."""

    def drape(garment, body, fabric, config, job):
        if asked is not None:
            asked.append(body.final.vertices)
        if len(asked or []) in refused:
            raise IntersectingError("7 pairs of triangles still cross")
        job.measure(seconds=1.5, error_mm=2.0)
        shift = body.final.vertices.mean(axis=0) - body.keyframes[0].mean(axis=0)
        return SimpleNamespace(
            mesh=TriangleMesh(garment.mesh.vertices + shift * (0, 1, 0), garment.mesh.faces), audit={"settled": True}
        )

    return drape


def test_each_pose_is_reported_and_shown_beside_the_others(worn, monkeypatch):
    asked = []
    monkeypatch.setattr(poses, "drape", riding(asked=asked))
    settings, job = poses.PosesConfig(poses=("arms_up", "step")), Job()
    made = poses.STAGES[0].run(worn, settings, job)
    report = made["pose_report"]["poses"]
    assert [one["pose"] for one in report] == ["arms_up", "step"]
    assert all(one["reached"] and one["settled"] and one["seconds"] == 1.5 for one in report)
    assert np.allclose(asked[1], named_pose(worn["avatar"], "step").vertices)
    assert report[0]["verdict"].startswith("arms up: ")
    assert [part.name for part in made["posed_scene"]] == [
        "arms_up garment",
        "arms_up body",
        "step garment",
        "step body",
    ]
    left, right = (made["posed_scene"][k].mesh.vertices[:, 0] for k in (1, 3))
    assert right.min() > np.median(left)


def test_a_pose_that_is_not_reached_costs_no_other(worn, monkeypatch):
    monkeypatch.setattr(poses, "drape", riding(refused=(1,), asked=[]))
    job = Job()
    made = poses.STAGES[0].run(worn, poses.PosesConfig(poses=("arms_up", "step")), job)
    assert [one["reached"] for one in made["pose_report"]["poses"]] == [False, True]
    assert job.warnings == ["arms up: not reached; 7 pairs of triangles still cross"]
    assert [part.name for part in made["posed_scene"]] == ["step garment", "step body"]


def test_an_interrupted_run_goes_on_after_the_last_pose(worn, monkeypatch, tmp_path):
    def interrupted(*arguments):
        if len(asked) == 1:
            raise KeyboardInterrupt
        return riding(asked=asked)(*arguments)

    asked, settings = [], poses.PosesConfig(poses=("arms_up", "step"))
    monkeypatch.setattr(poses, "drape", interrupted)
    with pytest.raises(KeyboardInterrupt):
        poses.STAGES[0].run(worn, settings, Job(kept=tmp_path))
    again = []
    monkeypatch.setattr(poses, "drape", riding(asked=again))
    made = poses.STAGES[0].run(worn, settings, Job(kept=tmp_path))
    assert len(again) == 1
    whole = poses.STAGES[0].run(worn, settings, Job())
    assert made["pose_report"] == whole["pose_report"]
