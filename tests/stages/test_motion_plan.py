"""How a motion is given, and what leads from it to a garment's frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from vto_pipeline.avatar.template.template import template
from vto_pipeline.errors import ConfigError, InputError, PlanError
from vto_pipeline.io.bodies.avatars import write_avatar
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.stages.entry.documents import drape_order
from vto_pipeline.stages.entry.planning import catalogue, planned_document

SHIRT, COAT, BODY, AVATAR = map(Path, ("shirt.obj", "coat.obj", "body.ply", "avatar.npz"))


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_avatar(AVATAR, template(0.0))
    for path in (SHIRT, COAT, BODY):
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def order(garments, body, motion):
    return drape_order(garments, ["denim"], body, None, None, False, "here", motion)


def plan(document):
    return planned_document(document, Path.cwd(), [], catalogue())[1]


def written(given, want):
    Path("d.yaml").write_text(f"schema: 1\ngiven: {{fabric: denim, motion: walking_step, {given}}}\nwant: [{want}]\n")
    return load_yaml(Path("d.yaml"))


def test_a_motion_leads_to_frames_and_a_scene():
    found = plan(order([SHIRT], AVATAR, "walking_step").document)
    names = [step.stage.name for step in found.steps]
    assert names.index("drape") < names.index("follow") < names.index("animate")
    assert names.index("move") < names.index("follow")
    assert found.makers["draped_motion"] == "follow"
    without = plan(order([SHIRT], AVATAR, None).document)
    assert "follow" not in [step.stage.name for step in without.steps]


def test_a_plain_mesh_cannot_move():
    with pytest.raises(ConfigError, match=r"needs a body with joints, and body\.ply is a plain mesh") as caught:
        order([SHIRT], BODY, "sitting")
    assert "vto fit --scan FILE" in caught.value.hint
    with pytest.raises(PlanError, match="draped_motion cannot be made") as caught:
        plan(written("garment: {mesh: shirt.obj}, body: {mesh: body.ply}", "draped_motion"))
    assert "body.avatar" in caught.value.hint


def test_only_one_garment_moves():
    with pytest.raises(ConfigError, match="only possible with one garment"):
        order([SHIRT, COAT], AVATAR, "sitting")
    given = "garments: {shirt: {mesh: shirt.obj}, coat: {mesh: coat.obj}}, body: {avatar: avatar.npz}"
    with pytest.raises(ConfigError, match="only one garment can follow a motion"):
        plan(written(given, "draped"))


def test_an_unknown_preset_is_refused_with_those_there_are():
    with pytest.raises(InputError, match="no file and no preset has the name siting") as caught:
        plan(order([SHIRT], AVATAR, "siting").document)
    assert "walking_step" in caught.value.hint
