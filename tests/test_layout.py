"""The house rules that a machine can check."""

from __future__ import annotations

import ast
import inspect
import pickle
import statistics
from pathlib import Path

import pytest

from vto_pipeline import errors
from vto_pipeline.cli.work import catalogue, planned

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "vto_pipeline").rglob("*.py"))
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
FAMILY = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if kind.__module__ == errors.__name__]
BANNED = {"utils", "helpers", "common", "manager", "core", "misc"}


def test_files_stay_short():
    lengths = {path: len(path.read_text().splitlines()) for path in MODULES}
    assert {path.name: length for path, length in lengths.items() if length > 400} == {}
    assert 20 < statistics.median(length for length in lengths.values() if length > 1) < 150


def test_no_room_for_odds_and_ends():
    assert [path for path in MODULES if path.stem in BANNED or path.parent.name in BANNED] == []


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_module_says_what_it_is(path):
    text = path.read_text()
    assert ast.get_docstring(ast.parse(text)) or (path.name == "__init__.py" and not text)


@pytest.mark.parametrize("kind", FAMILY)
def test_errors_are_one_family_with_known_exit_codes(kind):
    assert issubclass(kind, errors.VtoError)
    assert kind is errors.VtoError or 2 <= kind.exit_code <= 6


def test_no_error_class_outside_the_family():
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and node.name.endswith(("Error", "Exception")):
                assert path.name == "errors.py", f"{node.name} in {path}"


def test_errors_cross_process_borders_whole():
    error = errors.DivergedError("blew up", where="stage drape", hint="smaller steps", partial={"draped": [1, 2]})
    twin = pickle.loads(pickle.dumps(error))
    assert type(twin) is errors.DivergedError
    assert str(twin) == "error: blew up\n  in stage drape\n  hint: smaller steps"
    assert twin.partial == {"draped": [1, 2]}


def test_there_are_configs():
    assert CONFIGS


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.name)
def test_every_config_validates_and_plans(path):
    request, plan = planned(path, (), catalogue())
    made = {artifact for step in plan.steps for artifact in step.stage.makes}
    assert made.issuperset(request.want)
    assert all(plan.left_out.values())
