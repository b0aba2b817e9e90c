"""What a figure depends on: found without importing, named as git names it, and compared with what is there now."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vto_pipeline.bench import BENCHES
from vto_pipeline.bench.sources import changed_sources, content_name, sources_of

FILES = {
    "vto_pipeline/__init__.py": "",
    "vto_pipeline/bench/__init__.py": "from vto_pipeline.bench import other\n",
    "vto_pipeline/bench/other.py": "",
    "vto_pipeline/bench/one.py": "from typing import TYPE_CHECKING\nimport json, vto_pipeline.far.away\n"
    "if TYPE_CHECKING:\n    from vto_pipeline import typed\nelse:\n    from vto_pipeline import untyped\n"
    "def late():\n    from vto_pipeline.cloth import solve as s, SETTINGS\n",
    "vto_pipeline/cloth/__init__.py": "from vto_pipeline.cloth.settings import SETTINGS\n",
    "vto_pipeline/cloth/settings.py": "",
    "vto_pipeline/cloth/solve.py": "",
    "vto_pipeline/cloth/fabrics.yaml": "",
    "vto_pipeline/cloth/presets/denim.yaml": "",
    "vto_pipeline/cloth/notes.md": "",
    "vto_pipeline/cloth/hidden/__init__.py": "",
    "vto_pipeline/cloth/hidden/data.csv": "",
    "vto_pipeline/far/__init__.py": "",
    "vto_pipeline/far/away.py": "",
    "vto_pipeline/typed.py": "",
    "vto_pipeline/untyped.py": "",
}
DRIVEN = set(FILES) - {
    "vto_pipeline/bench/other.py",  # only the table of benches has it
    "vto_pipeline/typed.py",  # only for the type checker
    "vto_pipeline/cloth/hidden/__init__.py",
    "vto_pipeline/cloth/hidden/data.csv",
    "vto_pipeline/cloth/notes.md",
}


@pytest.fixture
def toy(tmp_path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_bench_depends_on_what_it_imports_wherever_it_does(toy):
    assert set(sources_of(["vto_pipeline.bench.one"], toy)) == DRIVEN


@pytest.mark.parametrize("name", ["body", "physics", "integrators"])
def test_all_that_python_loads_for_a_bench_is_among_its_sources(name):
    """But for what the table of all benches loads."""
    listing = "import sys; print(*(n for n in sys.modules if n.startswith('vto_pipeline.')))"
    loaded = [
        set(
            subprocess.run([sys.executable, "-c", f"{first}; {listing}"], capture_output=True, text=True).stdout.split()
        )
        for first in ("import vto_pipeline.bench", f"import {BENCHES[name].module}")
    ]
    names = {module.replace(".", "/") for module in loaded[1] - loaded[0]}
    found = {path.removesuffix(".py").removesuffix("/__init__") for path in sources_of([BENCHES[name].module])}
    assert len(names) > 10
    assert names <= found


def test_a_bench_of_cloth_does_not_depend_on_scans():
    found = sources_of([BENCHES["physics"].module])
    assert "vto_pipeline/cloth/constraints/bending/hinge.py" in found
    assert not [path for path in found if path.startswith(("vto_pipeline/scan/", "vto_pipeline/avatar/"))]


def test_a_content_has_the_name_that_git_gives_it(tmp_path):
    if shutil.which("git") is None:
        pytest.skip("no git")
    for data in (b"", b"one\n", bytes(range(256)) * 300):
        (tmp_path / "file").write_bytes(data)
        said = subprocess.run(["git", "hash-object", "file"], cwd=tmp_path, capture_output=True, text=True)
        assert content_name(tmp_path / "file") == said.stdout.strip()


def test_what_has_changed_or_gone_since_is_named(toy):
    document = {"sources": sources_of(["vto_pipeline.bench.one"], toy)}
    assert changed_sources(document, toy) == []
    (toy / "vto_pipeline/typed.py").write_text("# drives nothing\n")
    assert changed_sources(document, toy) == []
    (toy / "vto_pipeline/cloth/presets/denim.yaml").write_text("heavier")
    (toy / "vto_pipeline/cloth/solve.py").unlink()
    assert changed_sources(document, toy) == ["vto_pipeline/cloth/presets/denim.yaml", "vto_pipeline/cloth/solve.py"]
    assert changed_sources({}, toy) is None
