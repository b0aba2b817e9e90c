"""A drape that fails leaves what it reached in a form that the table of artifacts can write."""

from pathlib import Path

import numpy as np
import pytest

import vto_pipeline.cloth.drape as drape_module
from vto_pipeline.cloth.drape import drape
from vto_pipeline.errors import IntersectingError
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.io.runs.artifacts import ARTIFACTS
from vto_pipeline.model.mesh import TriangleMesh

KINDS = {kind.name: kind for kind in ARTIFACTS}


def test_the_partial_result_of_a_failed_drape_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    grid = np.stack(np.meshgrid(np.linspace(0, 0.1, 5), np.linspace(0, 0.1, 5)), -1).reshape(-1, 2)
    sheet = np.insert(grid, 1, 0.3, axis=1)
    corner = (np.arange(16) // 4) * 5 + np.arange(16) % 4
    faces = np.vstack(
        [np.stack([corner, corner + 5, corner + 1], 1), np.stack([corner + 1, corner + 5, corner + 6], 1)]
    )
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 0) for z in (-1, 1)], float)
    sides = "013 032 467 475 045 051 267 263 046 062 157 173"
    body = TriangleMesh(box, np.array([[int(c) for c in side] for side in sides.split()]))
    judge = drape_module.audit
    monkeypatch.setattr(drape_module, "audit", lambda *a, **k: {**judge(*a, **k), "body_intersections": 1})
    with pytest.raises(IntersectingError) as caught:
        drape(
            TriangleMesh(sheet, faces),
            body,
            read_fabric("cotton_poplin"),
            {"settle_seconds": 0.1, "place": "as_it_stands"},
            None,
        )
    assert set(caught.value.partial) >= {"draped", "audit"}
    for name, value in caught.value.partial.items():
        KINDS[name].write(tmp_path / KINDS[name].filename, value)
        assert (tmp_path / KINDS[name].filename).stat().st_size > 0
