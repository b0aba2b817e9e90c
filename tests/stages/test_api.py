"""The Python functions run what the command line runs, and read back what it made."""

from __future__ import annotations

import pytest
from numpy.testing import assert_array_equal

from vto_pipeline import api
from vto_pipeline.cli.main import main
from vto_pipeline.errors import ConfigError, InputError

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


def test_what_does_not_go_together_is_refused_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="give one of"):
        api.fit()
    with pytest.raises(ConfigError, match="either a body or measurements"):
        api.drape("shirt.ply")
    with pytest.raises(ConfigError, match="no such role"):
        api.scan("shirt.ply", "hat")
    assert list(tmp_path.iterdir()) == []
