"""The command itself: quick to answer, helpful about its own words."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import click
import pytest

from vto_pipeline.cli import main as main_module
from vto_pipeline.cli.main import COMMANDS

HEAVY = {"numpy", "scipy", "numba", "pydantic", "yaml", "rich", "open3d", "pycolmap", "cv2", "trimesh", "matplotlib"}


def test_help_answers_at_once():
    command = [sys.executable, "-m", "vto_pipeline.cli.main", "--help"]
    seconds = []
    for _ in range(5):
        start = sum(os.times()[2:4])  # CPU time of children: other work on the machine does not count
        subprocess.run(command, check=True, capture_output=True)
        seconds.append(sum(os.times()[2:4]) - start)
    assert 0.0 < min(seconds) < 0.3  # the contract; what else runs can only make it slower


def test_help_loads_nothing_heavy():
    source = f"""
import json, sys
from vto_pipeline.cli.main import main
for arguments in [["--help"], *([name, "--help"] for name in {list(COMMANDS)})]:
    assert main(arguments) == 0
print(json.dumps(sorted(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", source], check=True, capture_output=True, text=True)
    loaded = {name.partition(".")[0] for name in json.loads(done.stdout.splitlines()[-1])}
    assert "click" in loaded
    assert not loaded & HEAVY


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_has_help_and_the_common_options(name, vto):
    said = vto(name, "--help")
    assert said.code == 0
    assert "--json" in said.out
    assert "--verbose" in said.out
    command = getattr(import_module(f"vto_pipeline.cli.commands.{name}"), f"{name}_command")
    assert isinstance(command, click.Command)
    assert command.name == name


def test_words_it_does_not_know(vto):
    said = vto("darpe")
    assert (said.code, said.out) == (2, "")
    assert "no such command: darpe\n  hint: did you mean drape?" in said.err
    said = vto("plan", "toy.yaml", "--jsn")
    assert said.code == 2
    assert "--json" in said.err


def test_bad_usage_is_json_where_json_is_asked_for(vto):
    said = vto("plan", "--json")
    assert said.code == 2
    assert said.data["exit_code"] == 2
    assert "FILE.yaml" in said.data["error"]["problem"]


def test_the_table_of_commands_is_the_folder(request):
    folder = request.config.rootpath / "vto_pipeline" / "cli" / "commands"
    modules = {path.stem for path in folder.glob("*.py")} | {path.parent.name for path in folder.glob("*/__init__.py")}
    assert set(COMMANDS) == modules - {"__init__"}
    assert main_module.vto.list_commands(click.Context(main_module.vto)) == list(COMMANDS)


LOSING = "try: time.sleep(60)\n    except KeyboardInterrupt: raise RuntimeError('no compiled object yet') from None"
"""What Numba's compiler makes of an interrupt."""


DROPPING = """\
    import weakref
    class Thing:
        def __del__(self): time.sleep(60)
    Thing()
    thing = type("Other", (), {})()
    reference = weakref.ref(thing, lambda _: time.sleep(60))
    del thing
    time.sleep(60)
""".strip()
"""Code out of which nothing can be raised, twice, before code that can be interrupted."""


PAGE = (Path(__file__).parents[2] / "docs" / "files.md").read_text()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_as_the_page_says(shell, monkeypatch, capsys):
    assert f"_VTO_COMPLETE={shell}_source vto" in PAGE
    if shell == "bash" and not shutil.which("bash"):
        pytest.skip("no bash, whose version is asked for")
    monkeypatch.setenv("_VTO_COMPLETE", f"{shell}_source")
    with pytest.raises(SystemExit, match="0"):
        main_module.main([])
    assert f"_VTO_COMPLETE={shell}_complete" in capsys.readouterr().out
    for typed, wanted in (("vto bat", "batch"), ("vto batch --mem", "--memory"), ("vto batch f --sche", "--scheduler")):
        last = typed.split()[-1]
        monkeypatch.setenv("_VTO_COMPLETE", f"{shell}_complete")
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", last if shell == "fish" else str(len(typed.split()) - 1))
        with pytest.raises(SystemExit, match="0"):
            main_module.main([])
        assert wanted in capsys.readouterr().out


LOADED = "from vto_pipeline.scan.photos.sfm import load_colmap; load_colmap(0)"
"""A library with a handler of its own."""


@pytest.mark.parametrize(
    ("before", "waiting"),
    [("pass", "time.sleep(60)"), ("pass", LOSING), ("pass", DROPPING), (LOADED, "time.sleep(60)")],
    ids=["plain", "lost by a library", "dropped by Python", "taken by a library"],
)
@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_sigterm_ends_a_command_like_ctrl_c(tmp_path, before, waiting, stop):
    """A termination removes temporary files, as a kill cannot."""
    program = (
        "import time; from vto_pipeline.cli import main; from vto_pipeline.io.files import process_folder\n"
        f"def wait(*_, **__):\n    {before}\n    print(process_folder(), flush=True)\n    {waiting}\n"
        "main.vto.main = wait; raise SystemExit(main.main([]))"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        folder = Path(process.stdout.readline().strip())
        assert folder.is_dir()
        process.send_signal(stop)
        _, said = process.communicate()
    assert (process.returncode, said) == (130, "interrupted; run the same command again to resume\n")
    assert not folder.exists()
