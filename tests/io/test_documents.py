"""YAML with lines, schemas with suggestions, JSON with one form per value."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydantic import Field

from vto_pipeline.errors import ConfigError, FormatError, InputError
from vto_pipeline.io.documents import check_schema, load_yaml, read_json, suggest, write_json
from vto_pipeline.model.settings import Config

TEXT = """\
schema: 1
stages:
  sfm: {max_keypoint: 5000, tolerance: 1e-5}
want: [surface,
  page]
"""


class Sfm(Config):
    max_keypoints: int = Field(default=2000, gt=0)
    tolerance: float = 1e-3


class Stages(Config):
    sfm: Sfm = Field(default_factory=Sfm)


class Whole(Config):
    schema_: int = Field(alias="schema")
    stages: Stages = Field(default_factory=Stages)
    want: list[str] = Field(default_factory=list)


def written(folder: Path, text: str, name: str = "demo.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    document = load_yaml(written(tmp_path, TEXT))
    for number, line in enumerate(TEXT.splitlines(), start=1):
        for keys in (("schema",), ("stages",), ("stages", "sfm"), ("stages", "sfm", "max_keypoint"), ("want",)):
            if f"{keys[-1]}:" in line:
                assert document.line_of(keys) == number
    assert document.line_of(("want", 1)) == 5
    assert document.line_of(("stages", "stereo")) is None
    assert document.where(("stages", "stereo", "size")).endswith("demo.yaml, line 2")


def test_numbers_in_scientific_form_are_numbers(tmp_path: Path) -> None:
    data = load_yaml(written(tmp_path, "a: 1e-5\nb: 1.5e3\nc: -2E+4\nd: 1.1e-5\ne: e5\nf: 12")).data
    assert data == {"a": 1e-5, "b": 1500.0, "c": -2e4, "d": 1.1e-5, "e": "e5", "f": 12}


def test_a_misspelt_key_is_named_with_line_value_and_suggestion(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        check_schema(load_yaml(written(tmp_path, TEXT)), Whole)
    assert caught.value.problem == "stages.sfm.max_keypoint: unknown key (got 5000)"
    assert caught.value.where.endswith("demo.yaml, line 3")
    assert caught.value.hint == "did you mean max_keypoints?"


def test_a_value_out_of_range_is_named_with_its_limit(tmp_path: Path) -> None:
    path = written(tmp_path, "schema: 1\nstages: {sfm: {max_keypoints: -3}}")
    with pytest.raises(ConfigError, match="max_keypoints: input should be greater than 0 \\(got -3\\)"):
        check_schema(load_yaml(path), Whole)


@pytest.mark.parametrize(
    ("text", "problem", "line"),
    [
        ("a: 1\nb: 2\na: 3\n", "a: given twice (also in line 1)", 3),
        ("a: 1\nb: [1, 2\nc: 3\n", "not valid YAML", 3),
        ("a: 1\n\tb: 2\n", "not valid YAML", 2),
        ("a: !!python/object/apply:os.system ['true']\n", "not valid YAML", 1),
        ("[" * 100 + "]" * 100, "nested deeper than 32", 1),
        ("a: &a [1]\n" + "b: [" + ", ".join(["*a"] * 100) + "]", "more than 16 aliases", 2),
    ],
)
def test_bad_yaml_is_refused_with_its_line(tmp_path: Path, text: str, problem: str, line: int) -> None:
    with pytest.raises(ConfigError) as caught:
        load_yaml(written(tmp_path, text))
    assert problem in caught.value.problem
    assert caught.value.where.endswith(f"line {line}")


@pytest.mark.parametrize("text", ["&a [*a]", "&a {b: *a}"])
def test_yaml_that_contains_itself_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="contains itself"):
        load_yaml(written(tmp_path, text))


def test_missing_empty_and_foreign_files_are_named(tmp_path: Path) -> None:
    written(tmp_path, "a: 1", "demo.yaml")
    with pytest.raises(InputError) as caught:
        load_yaml(tmp_path / "demos.yaml", error=InputError)
    assert caught.value.problem == "no such file"
    assert caught.value.hint == "did you mean demo.yaml?"
    with pytest.raises(ConfigError, match="empty"):
        load_yaml(written(tmp_path, "", "empty.yaml"))
    with pytest.raises(ConfigError, match="not supported; expected .json, .yaml, .yml"):
        load_yaml(written(tmp_path, "a: 1", "demo.txt"))
    (tmp_path / "latin.yaml").write_bytes(b"name: caf\xe9")
    with pytest.raises(ConfigError, match="not UTF-8 text \\(byte 9\\)"):
        load_yaml(tmp_path / "latin.yaml")


def test_json_comes_back_exactly_and_has_one_form(tmp_path: Path) -> None:
    numbers = np.array([0.1, 1 / 3, 1e-300, 5e-324, 1.7976931348623157e308, -0.0])
    write_json(tmp_path / "a.json", {"b": numbers, "a": (1, True, None), "c": Path("x")})
    write_json(tmp_path / "b.json", {"c": Path("x"), "a": [1, True, None], "b": list(numbers)})
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert np.array(read_json(tmp_path / "a.json")["b"]).tobytes() == numbers.tobytes()
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["a.json", "b.json"]  # nothing left beside them


def test_json_without_a_json_form_leaves_the_old_file(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", 1)
    with pytest.raises(ValueError, match="Out of range"):
        write_json(tmp_path / "a.json", float("nan"))
    assert read_json(tmp_path / "a.json") == 1
    with pytest.raises(FormatError, match="not valid JSON"):
        read_json(written(tmp_path, '{"a": ', "cut.json"))


def test_suggestions() -> None:
    assert suggest("waist_grith", ["waist_girth", "hip_girth"]) == "did you mean waist_girth?"
    assert suggest("zzz", ["b", "a"]) == "allowed: a, b"
