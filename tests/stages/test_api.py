"""The Python functions run what the command line runs, and read back what it made."""

from __future__ import annotations

import subprocess
import sys

import pytest
from numpy.testing import assert_array_equal

import vto_pipeline
from vto_pipeline import api
from vto_pipeline.cli.main import main
from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.stages.entry import commands

TAPE = "unit: cm\nsex: female\nmeasurements: {stature: 170, bust_girth: 93, waist_girth: 78, hip_girth: 101}\n"


def test_a_fit_gives_the_avatar_of_the_command_line(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tape.yaml").write_text(TAPE)
    found = api.fit(measurements="tape.yaml", output="here")
    assert main(["fit", "--measurements", "tape.yaml", "-o", "there"]) == 0
    capfd.readouterr()
    assert found.path("avatar").read_bytes() == (tmp_path / "there" / "out" / "avatar.npz").read_bytes()
    assert found.read("measurements").values["waist_girth"] == pytest.approx(0.78, abs=0.01)
    again = api.open_run("here")
    assert again.record["wanted"] == found.record["wanted"]
    assert 0 < again.seconds < found.seconds + 1
    assert_array_equal(again.read("avatar").vertices, found.read("avatar").vertices)
    with pytest.raises(InputError, match="made no draped"):
        found.read("draped")


def test_a_document_may_be_a_mapping_and_settings_a_mapping_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tape.yaml").write_text(TAPE)
    document = {"schema": 1, "given": {"body": {"measurements": "tape.yaml"}}, "want": ["avatar"]}
    posed = api.run(document, settings={"pose.pose": "t_pose"})
    assert posed.folder.name == "document"
    with pytest.raises(ConfigError, match="unknown"):
        api.run(document, settings={"pose.posse": "t_pose"})


def test_a_run_never_gives_what_a_later_one_made_in_its_folder(tmp_path, monkeypatch):
    """Two calls that name no folder share one: the first must not answer with the second's avatar."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tape.yaml").write_text(TAPE)
    document = {"schema": 1, "given": {"body": {"measurements": "tape.yaml"}}, "want": ["avatar", "measurements"]}
    first = api.run(document)
    again = api.run(document)  # the same results
    assert_array_equal(first.read("avatar").vertices, again.read("avatar").vertices)
    (tmp_path / "tape.yaml").write_text(TAPE.replace("waist_girth: 78", "waist_girth: 90"))
    later = api.run(document)
    assert later.read("measurements").values["waist_girth"] == pytest.approx(0.90, abs=0.01)
    assert "a later run has replaced" in first._repr_html_()  # and no traceback in a notebook
    for asked in (lambda: first.read("measurements"), lambda: again.path("avatar"), lambda: first.made("avatar")):
        with pytest.raises(InputError, match="a later run has replaced"):
            asked()


@pytest.mark.parametrize(
    ("limits", "problem"),
    [
        ({"time_budget": 5.0}, "no stage of this run works to a time"),
        ({"target_error": 1e-3}, "no drape in this run"),
        ({"time_budget": 0}, "time_budget is a positive number"),
        ({"memory": "8GB"}, "memory is a positive number"),
        ({"target_error": float("nan")}, "target_error is a positive number"),
    ],
)
def test_limits_reach_the_run(tmp_path, monkeypatch, limits, problem):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tape.yaml").write_text(TAPE)
    document = {"schema": 1, "given": {"body": {"measurements": "tape.yaml"}}, "want": ["avatar"]}
    with pytest.raises(ConfigError, match=problem):
        api.run(document, **limits)
    assert api.run(document, memory=7e9).record["memory_budget_mb"] == 7000.0


def test_a_drape_takes_the_limits_of_a_run(monkeypatch):
    taken = {}
    monkeypatch.setattr(commands, "run_order", lambda *_, **options: taken.update(options))
    api.drape("shirt.ply", body="customer.ply", time_budget=60.0, target_error=1e-3, memory=8e9)
    assert (taken["time_budget"].seconds, taken["target_error"], taken["memory"]) == (60.0, 1e-3, 8e9)


@pytest.mark.parametrize("package", [api, vto_pipeline])
def test_what_does_not_go_together_is_refused_before_anything_runs(package, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="give one of"):
        package.fit()
    with pytest.raises(ConfigError, match="either a body or measurements"):
        package.drape("shirt.ply")
    with pytest.raises(ConfigError, match="no such role"):
        package.scan("shirt.ply", "hat")
    with pytest.raises(ConfigError, match="no such file"):
        package.run("absent.yaml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("first", ["vto_pipeline", "vto_pipeline.scan.similarity"])
def test_the_package_is_called_for_a_scan_whether_it_was_loaded_or_not(first):
    asked = f"import {first}, vto_pipeline; print(callable(vto_pipeline.scan), hasattr(vto_pipeline, 'scam'))"
    found = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["True", "False"]
