"""A garment and the body that it was on, from a file with z up: cloth falls along the avatar's -Y, not the file's."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.io.meshes import read_mesh
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.stages import CATALOGUE, avatar, cloth, outfit

SAMPLES = Path(__file__).parents[2] / "sample_data" / "shirt_on_form"
LAYERS = SimpleNamespace(meshes={}, audit={}, trace=())
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def pair() -> tuple[TriangleMesh, TriangleMesh]:
    """The sample shirt on its form."""
    return read_mesh(SAMPLES / "shirt.ply"), read_mesh(SAMPLES / "form.ply")


@pytest.mark.parametrize("turn", [np.eye(3), Z_UP])
def test_what_is_draped_stands_as_the_body_does(pair, turn: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    shirt, form = pair
    garment = TriangleMesh(shirt.vertices @ turn.T, shirt.faces)
    inputs = {
        "sim_mesh": garment,
        "rest_shape": RestShape(garment.vertices),
        "collider": None,
        "fabric": None,
    }
    source = {"mannequin_surface": TriangleMesh(form.vertices @ turn.T, form.faces)}
    inputs |= avatar._stand_source(source, None, Job())
    seen = []

    def take(garment, *_):  # type: ignore[no-untyped-def]
        seen.append(garment)
        return SimpleNamespace(mesh=garment.mesh, audit={}, trace=())

    monkeypatch.setattr(cloth, "assumption_notes", lambda fabric: ())
    monkeypatch.setattr(cloth, "worn_rest", lambda garment, *_: take(garment) and garment.rest)
    monkeypatch.setattr(cloth, "drape", take)
    inputs["worn_rest"] = cloth._grade(inputs, cloth.GradeConfig(), Job())["worn_rest"]
    cloth._drape(inputs, None, Job())

    monkeypatch.setattr(outfit, "assumption_notes", lambda fabric: ())
    monkeypatch.setattr(outfit, "drape_layers", lambda layers, *_: take(layers[0].garment) and LAYERS)
    rows = {row.name: row for row in outfit.outfit_tables(CATALOGUE, ("vest", "coat")).stages}
    layered = {f"{name}_{key}": inputs[key] for name in ("vest", "coat") for key in ("sim_mesh", "worn_rest", "fabric")}
    assert "source_turn" in rows["drape"].optional
    rows["drape"].run({**layered, "collider": None, "source_turn": inputs["source_turn"]}, None, Job())
    assert len(seen) == 3
    for given in seen:
        assert_allclose(given.mesh.vertices, shirt.vertices, rtol=0, atol=1e-12)
        assert_allclose(given.rest.positions, shirt.vertices, rtol=0, atol=1e-12)
