"""vto info and vto prune."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.template.template import template
from vto_pipeline.cli.describe import DESCRIPTIONS
from vto_pipeline.pipeline.batch.ledger import Ledger


def test_a_mesh_is_described_in_metres(vto):
    box = trimesh.creation.box((0.4, 1.5, 0.2))
    box.export("box.ply")
    said = vto("info", "box.ply", "--json")
    assert said.code == 0
    assert said.data["kind"] == "surface"
    assert said.data["size_m"] == pytest.approx([0.4, 1.5, 0.2])
    assert said.data["area_m2"] == pytest.approx(box.area)
    assert (said.data["closed"], said.data["pieces"], said.data["triangles"]) == (True, 1, 12)
    box.update_faces([True] * 10 + [False] * 2)
    box.export("open.ply")
    assert vto("info", "open.ply", "--json").data["closed"] is False
    assert any("assumed to be m" in note for note in said.data["notes"])


def test_a_body_of_a_wrong_unit_is_told_by_info(vto):
    """One in inches has the size of a form in centimetres; as points it is told, too, and a form is not."""
    body = named_pose(template(), "a_pose")
    inches = body.vertices / 0.0254
    trimesh.Trimesh(inches, body.faces, process=False).export("body.ply")
    trimesh.PointCloud(inches).export("cloud.ply")
    trimesh.creation.box((20.0, 36.0, 14.0)).export("form.ply")
    stature = f"{np.ptp(body.vertices[:, 1]):.2f} m if the file is in inches"
    for name, kind, said in (("body.ply", "surface", 1), ("cloud.ply", "cloud", 1), ("form.ply", "surface", 0)):
        data = vto("info", name, "--json").data
        assert (data["kind"], sum(stature in text for text in data["warnings"])) == (kind, said)


def test_every_kind_that_may_be_given_has_a_description(vto):
    assert DESCRIPTIONS.keys() == {
        "photos", "video", "depth", "cloud", "surface", "silhouettes", "measurements", "fabric", "avatar", "pattern"
    }  # fmt: skip
    Path("tape.yaml").write_text("unit: cm\nsex: female\nmeasurements: {chest_girth: 96, stature: 170, mass: 65}\n")
    said = vto("info", "tape.yaml", "--json")
    assert said.data["chest_girth_m"] == pytest.approx(0.96)
    assert said.data["mass_kg"] == 65
    Path("letter.yaml").write_text("sex: male\nsize: M\n")
    assert vto("info", "letter.yaml", "--json").data["kind"] == "measurements"
    assert vto("info", "nothing.ply").code == 3
    assert vto("info", "toy.yaml").code == 3


def test_openings_of_a_tube_are_two_circles(vto):
    tube = trimesh.creation.cylinder(radius=0.2, height=0.9, sections=400)
    tube.update_faces(abs(tube.face_normals[:, 2]) < 0.5)  # without its lids
    tube.export("tube.ply")
    said = vto("info", "tube.ply", "--json")
    assert said.data["openings"] == 2
    assert said.data["longest_openings_m"] == pytest.approx([2 * math.pi * 0.2] * 2, rel=1e-3)  # of 400 chords
    assert "1.257, 1.257" in vto("info", "tube.ply").out
    leaves = np.array([[0, 0, 0], [0, 1, 0], [0.3, 0, 0], [-0.3, 0, 0], [0, 0, 0.3]])
    trimesh.Trimesh(leaves, [[0, 1, 2], [0, 1, 3], [0, 1, 4]], process=False).export("book.ply")
    said = vto("info", "book.ply", "--json")  # one edge of three faces: no loops, and no refusal
    assert said.code == 0
    assert "openings" not in said.data
    assert any("openings not counted" in note for note in said.data["notes"])


def test_a_fabric_is_described_in_si(vto):
    Path("poplin.yaml").write_text("name: poplin\nareal_density_gsm: 120\nbending: {warp: 1.1e-5}\n")
    said = vto("info", "poplin.yaml", "--json")
    assert (said.data["kind"], said.data["areal_density_kg_per_m2"]) == ("fabric", pytest.approx(0.12))
    assert said.data["bending_warp_n_m"] == pytest.approx(1.1e-5)
    assert "thickness" in said.data["assumed"]
    assert "1.1e-05" in vto("info", "poplin.yaml").out  # not 0.000
    assert vto("scan", "poplin.yaml", "--role", "garment").code == 3


def test_a_run_is_described_by_its_record(vto):
    vto("run", "toy.yaml")
    said = vto("info", "runs/toy")
    assert said.code == 0
    assert "stages: 7 ran" in said.out
    assert vto("run", "toy.yaml", "--set", "add.fail=true").code == 4
    said = vto("info", "runs/toy").out
    assert "FAILED in add" in said
    assert said.startswith("not done after ")
    assert "1 failed, 3 not begun or not ended" in said
    assert "not made" in said
    assert "as given" not in said  # what is wanted was not


def test_a_batch_is_described_by_its_rows(vto, tmp_path):
    Ledger(tmp_path / "november", ["a", "b"]).save()
    assert vto("info", "november").out == vto("status", "november").out
    assert vto("info", "november", "--json").data["counts"] == {"waiting": 2}


def test_prune_keeps_what_the_latest_run_used(vto):
    vto("run", "toy.yaml")
    vto("run", "toy.yaml", "--set", "add.offset=1")
    stored = sorted(Path("runs/toy/cache").glob("*/*/manifest.json"))
    said = vto("prune", "runs/toy", "--dry-run", "--json")
    removable = said.data["results"]
    assert removable > 0
    assert sorted(Path("runs/toy/cache").glob("*/*/manifest.json")) == stored
    said = vto("prune", "runs/toy", "--json")
    assert (said.data["results"], said.data["removed"]) == (removable, True)
    assert len(list(Path("runs/toy/cache").glob("*/*/manifest.json"))) == len(stored) - removable
    again = vto("run", "toy.yaml", "--set", "add.offset=1", "--json")
    assert {stage["status"] for stage in again.data["stages"]} == {"cached", "ran", "left_out"}
    assert [stage["name"] for stage in again.data["stages"] if stage["status"] == "ran"] == ["page"]
    assert json.loads(vto("prune", "runs/toy", "--json").out)["results"] == 0
    assert vto("prune", ".").code == 3
