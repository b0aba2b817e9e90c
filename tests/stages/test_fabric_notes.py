"""The drape says what its fabric assumes, whatever the fabric was read from."""

from __future__ import annotations

from pathlib import Path

import pytest

import vto_pipeline.stages.cloth as cloth_stages
from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.job import Job

FILES = {
    "a.yaml": "areal_density_gsm: 120\n",
    "kes.yaml": "instrument: KES-FB\nW: 12\nEMT: 5\n",
    "fast.csv": "instrument, FAST\nW, 120\nE100, 5\n",
    "a.u3m": '{"schema": "1.1", "material": {"name": "a", "physics": {"weight": 120, "devices": {"fab": "null"}}}}',
}


@pytest.mark.parametrize("name", FILES)
def test_what_is_assumed_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    class Draped:
        mesh, audit, trace = None, {}, ()

    monkeypatch.setattr(cloth_stages, "drape", lambda *a: Draped())
    monkeypatch.setattr(cloth_stages, "Garment", lambda *a, **named: None)
    (tmp_path / name).write_text(FILES[name])
    job = Job()
    (stage,) = [stage for stage in cloth_stages.STAGES if stage.name == "drape"]
    stage.run(
        {"sim_mesh": None, "worn_rest": None, "collider": None, "fabric": read_fabric(tmp_path / name)}, None, job
    )
    assert "assumed, not measured: thickness 0.267 mm" in job.notes[0]
    stretch = name in ("kes.yaml", "fast.csv")
    assert ("stretch_warp 1" in job.notes[0]) != stretch
    assert any("stretch_warp: secant" in note for note in job.notes) == stretch
