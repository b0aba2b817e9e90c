"""A sewing pattern as a garment: the plan sews it, and what is sewn comes back from its file with its panels."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.geometry.topology import boundary_loops, face_area_vectors
from vto_pipeline.io.runs.artifacts import ARTIFACTS
from vto_pipeline.model.job import Job
from vto_pipeline.stages.entry.documents import drape_order
from vto_pipeline.stages.entry.planning import catalogue, planned_document

TAPE = Path(__file__).parents[2] / "sample_data" / "customer" / "measurements.yaml"


def write_tube(path: Path) -> None:
    """Two rectangles of 60 by 50 cm, one behind the other and facing away, sewn along both sides."""
    front = {"vertices": [[-30, 0], [30, 0], [30, 50], [-30, 50]], "translation": [0, 70, 20]}
    front["edges"] = [{"endpoints": [k, (k + 1) % 4]} for k in range(4)]
    panels = {"front": front, "back": front | {"rotation": [0, 180, 0], "translation": [0, 70, -20]}}
    stitches = [[{"panel": "front", "edge": a}, {"panel": "back", "edge": b}] for a, b in ((1, 3), (3, 1))]
    path.write_text(json.dumps({"pattern": {"panels": panels, "stitches": stitches}, "properties": {}}))


def test_a_pattern_is_sewn_before_it_is_taken(tmp_path):
    write_tube(tmp_path / "tube.json")
    order = drape_order([tmp_path / "tube.json"], ["denim"], None, TAPE, None, False, "drape")
    assert "pattern" in order.document.data["given"]["garment"]
    request, plan, _ = planned_document(order.document, tmp_path, (), catalogue())
    names = [step.stage.name for step in plan.steps]
    assert names.index("sew") < names.index("take_mesh") < names.index("drape")
    stage = next(step.stage for step in plan.steps if step.stage.name == "sew")
    made = stage.run({"garment_pattern": request.given["garment_pattern"].read(Job())}, stage.settings(), Job())
    mesh = made["garment_mesh"]
    area = np.linalg.norm(face_area_vectors(mesh), axis=1).sum()
    assert area == pytest.approx(0.6, rel=0.01)
    assert len(boundary_loops(mesh)) == 2
    kinds = {kind.name: kind for kind in ARTIFACTS}
    for name in ("garment_mesh", "panels"):
        kind = kinds[name]
        kind.write(tmp_path / kind.filename, made[name])
        back = kind.read(tmp_path / kind.filename)
        if name == "garment_mesh":
            assert (back.texture == mesh.texture).all()
            assert (back.vertices == mesh.vertices).all()
        for file, preview in kind.previews:
            preview(tmp_path / file, made[name])
    assert {path.name for path in tmp_path.glob("panels.*")} == {"panels.json", "panels.svg", "panels.dxf"}


def test_several_garments_may_be_patterns_and_meshes(tmp_path):
    write_tube(tmp_path / "skirt.json")
    (tmp_path / "shirt.ply").write_text("ply")
    order = drape_order([tmp_path / "skirt.json", tmp_path / "shirt.ply"], ["denim"], None, TAPE, None, False, "drape")
    _, plan, _ = planned_document(order.document, tmp_path, (), catalogue())
    names = [step.stage.name for step in plan.steps]
    assert "skirt.sew" in names
    assert "shirt.sew" not in names
    assert {"skirt.take_mesh", "shirt.take_mesh"} <= set(names)
