"""The key changes with everything that decides a result's bytes, and with nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from toy_tables import TOY, AddConfig

from vto_pipeline.errors import MissingDependencyError
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.execution import key as key_module
from vto_pipeline.pipeline.execution.digest import digest_path, digest_value
from vto_pipeline.pipeline.execution.key import result_key, versions
from vto_pipeline.pipeline.plan import Step

ADD = next(stage for stage in TOY.stages if stage.name == "add")
STEP = Step(ADD, ("left_doubled",), AddConfig())
INPUTS = {"left_doubled": "aa"}


def test_defaults_written_out_are_the_same_key():
    assert result_key(STEP, INPUTS, 0, False) == result_key(
        replace(STEP, settings=AddConfig(offset=0)), INPUTS, 0, False
    )


@pytest.mark.parametrize(
    ("step", "inputs", "seed", "force_all"),
    [
        (replace(STEP, settings=AddConfig(offset=1)), INPUTS, 0, False),
        (replace(STEP, stage=replace(ADD, name="other")), INPUTS, 0, False),
        (replace(STEP, stage=replace(ADD, uses=("numpy", "scipy"))), INPUTS, 0, False),
        (STEP, {"left_doubled": "ab"}, 0, False),
        (STEP, {"left_doubled": "aa", "right_doubled": "aa"}, 0, False),
        (STEP, INPUTS, 1, False),
        (STEP, INPUTS, 0, True),
    ],
)
def test_each_part_counts(step, inputs, seed, force_all):
    assert result_key(step, inputs, seed, force_all) != result_key(STEP, INPUTS, 0, False)


def test_a_time_budget_counts_and_none_is_no_part_of_the_key():
    plain = result_key(STEP, INPUTS, 0, False)
    assert result_key(STEP, INPUTS, 0, False, None) == plain
    assert len({plain, result_key(STEP, INPUTS, 0, False, 60.0), result_key(STEP, INPUTS, 0, False, 61.0)}) == 3


def test_a_new_version_or_source_counts(monkeypatch):
    before = result_key(STEP, INPUTS, 0, False)
    monkeypatch.setattr(key_module, "_version", lambda name: "99")
    assert result_key(STEP, INPUTS, 0, False) != before
    monkeypatch.undo()
    monkeypatch.setattr(key_module, "code_identity", lambda: "another source")
    assert result_key(STEP, INPUTS, 0, False) != before


def test_what_is_not_installed_is_said():
    with pytest.raises(MissingDependencyError, match="no-such-thing is not installed"):
        versions(["no-such-thing"])


def test_folder_digest_is_of_visible_names_and_bytes(tmp_path: Path):
    one, two = tmp_path / "one", tmp_path / "elsewhere" / "two"
    for folder in (one, two):
        (folder / "inner").mkdir(parents=True)
        (folder / "a.txt").write_text("a")
        (folder / "inner" / "b.txt").write_text("b")
    (two / ".DS_Store").write_text("dust")
    assert digest_path(one) == digest_path(two)
    (two / "a.txt").rename(two / "c.txt")
    assert digest_path(one) != digest_path(two)


def test_an_inline_value_counts_by_the_content_of_its_files(tmp_path: Path):
    (tmp_path / "a.png").write_text("same")
    (tmp_path / "b.png").write_text("same")
    (tmp_path / "c.png").write_text("other")
    value = {"front": tmp_path / "a.png", "stature": 1.7}
    assert digest_value(value) == digest_value({"stature": 1.7, "front": tmp_path / "b.png"})
    assert digest_value(value) != digest_value({**value, "front": tmp_path / "c.png"})
    assert digest_value(value) != digest_value({**value, "stature": 1.8})


def test_settings_are_one_class_per_section():
    assert TOY.sections["double"] is Config
