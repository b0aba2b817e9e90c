"""vto info and vto prune."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh

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


def test_every_kind_that_may_be_given_has_a_description(vto):
    assert DESCRIPTIONS.keys() == {
        "photos", "video", "depth", "cloud", "surface", "silhouettes", "measurements", "avatar", "pattern"
    }  # fmt: skip
    Path("tape.yaml").write_text("unit: cm\nsex: female\nmeasurements: {chest_girth: 96, stature: 170}\n")
    said = vto("info", "tape.yaml", "--json")
    assert said.data["chest_girth_m"] == pytest.approx(0.96)
    assert vto("info", "nothing.ply").code == 3
    assert vto("info", "toy.yaml").code == 3


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
