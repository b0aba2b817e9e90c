"""The house rules that a machine can check."""

from __future__ import annotations

import ast
import inspect
import pickle
import re
import statistics
from collections import Counter
from collections.abc import Mapping, Set
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from vto_pipeline import errors
from vto_pipeline.stages.entry.planning import catalogue, planned

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "vto_pipeline").rglob("*.py"))


def dotted(path: Path) -> str:
    """Name of a module as it is imported."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


NAMES = frozenset(map(dotted, MODULES))
FOLDERS = sorted({path.parent for path in MODULES})
CONFIGS = sorted((ROOT / "configs").glob("*.yaml"))
FAMILY = [kind for _, kind in inspect.getmembers(errors, inspect.isclass) if kind.__module__ == errors.__name__]
BANNED = {"utils", "helpers", "common", "manager", "core", "misc"}


def test_files_stay_short():
    lengths = {path: len(path.read_text().splitlines()) for path in MODULES}
    assert {path.name: length for path, length in lengths.items() if length > 400} == {}
    assert 20 < statistics.median(length for length in lengths.values() if length > 1) < 150


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_folders_stay_small_and_have_a_map(folder):
    rooms = [path for path in folder.iterdir() if path.is_dir() and (path / "__init__.py").exists()]
    files = [path for path in folder.glob("*.py") if path.stem not in {"__init__", "__main__"}]
    assert len(files) <= 15
    assert len(rooms) <= 15
    if folder.parent != ROOT and len(files) + len(rooms) > 1:
        said = set(re.findall(r"\w+", (folder / "__init__.py").read_text()))
        assert {path.stem for path in files + rooms} - said == set(), "__init__ is the folder's map"


def test_test_files_have_names_of_their_own():
    """pytest imports them by name alone: two of a name end the collection."""
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_circle_of_imports():
    imports = {dotted(path): imported(path) for path in MODULES}
    assert circle(imports) is None


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: str(path.relative_to(ROOT)))
def test_no_circle_between_the_rooms_of_a_folder(folder):
    rooms: dict[str, set[str]] = {}
    inside = dotted(folder / "__init__.py") + "."
    for path in folder.glob("*/**/*.py"):
        room = path.relative_to(folder).parts[0]
        used = {name[len(inside) :].split(".")[0] for name in imported(path) if name.startswith(inside)}
        rooms.setdefault(room, set()).update(name for name in used if name != room and (folder / name).is_dir())
    assert circle(rooms) is None


def test_a_circle_would_be_seen():
    assert circle({"a": {"b"}, "b": {"c"}, "c": set()}) is None
    assert set(circle({"a": {"b"}, "b": {"c"}, "c": {"a"}})) == {"a", "b", "c"}


@cache
def imported(path: Path) -> frozenset[str]:
    """Return the modules of the package that a file imports, at its top or inside a function."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in NAMES else node.module)
    return frozenset(found & NAMES - {dotted(path)})


def circle(imports: Mapping[str, Set[str]]) -> list[str] | None:
    """Return a circle of a graph, or None."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(error.args[1])
    return None


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
