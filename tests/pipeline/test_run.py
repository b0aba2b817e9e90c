"""Running on the toy tables: caching, early cut-off, skipping, failing, resuming."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from toy_tables import CALLS, TOY

from vto_pipeline.errors import ComputationError, ConfigError, InputError
from vto_pipeline.pipeline.execution.final import make_finals_again
from vto_pipeline.pipeline.execution.folder import locked_run_folder

HEAD = "schema: 1\ngiven: {left: {number: left.txt}, right: {number: right.txt}}\n"
ALL = HEAD + "want: [squared, label, page]\n"


def status(record):
    return {stage["name"]: stage["status"] for stage in record["stages"]}


def test_a_run_makes_what_is_wanted_and_says_what_it_did(go, tmp_path):
    record = go(ALL)
    out = tmp_path / "run" / "out"
    assert (out / "squared.txt").read_text() == "196"  # (2·3 + 2·4)²
    assert (out / "total.preview").read_text() == "14"
    assert record == json.loads((tmp_path / "run" / "run.json").read_text()) | {"seconds": record["seconds"]}
    assert status(record)["guess"] == "left_out"
    double = next(stage for stage in record["stages"] if stage["name"] == "left.double")
    assert double["metrics"] == {"rms_mm": 0.25}
    assert double["notes"] == ["left.txt: read as a decimal number"]
    assert double["peak_mb"] > 1
    assert record["versions"]["numpy"]
    page = json.loads((out / "page.json").read_text())
    assert page["values"] == {"left_number": 3, "total": 14, "label": 11}
    assert page["statuses"]["square"] == "ran"


def test_a_second_run_takes_everything_from_the_cache_but_the_page(go):
    first = go(ALL)
    second = go(ALL)
    assert CALLS == ["page"]
    assert status(second)["add"] == "cached"
    for before, after in zip(first["stages"], second["stages"], strict=True):
        if after["status"] == "cached":  # tells what it cost when it was made
            assert (after["seconds"], after["warnings"]) == (before["seconds"], before["warnings"])


def test_a_change_reruns_what_depends_on_it_and_the_same_bytes_stop_the_cascade(go):
    go(ALL)
    go(ALL, ["add.offset=4"])  # total 18: parity is 1 as before, so label need not run again
    assert CALLS == ["add", "square", "parity", "page"]
    go(ALL, ["add.offset=1"])  # total 15, 15 // 2 is odd too
    assert CALLS == ["add", "square", "parity", "page"]
    go(ALL, ["add.offset=2"])  # total 16: parity 0
    assert CALLS == ["add", "square", "parity", "label", "page"]


def test_keys_know_content_only(go, tmp_path):
    go(ALL)
    os.utime(tmp_path / "left.txt", (1, 1))
    (tmp_path / "left.txt").rename(tmp_path / "other.txt")
    go(ALL.replace("left.txt", "other.txt"))
    assert CALLS == ["page"]
    (tmp_path / "other.txt").write_text("5")
    go(ALL.replace("left.txt", "other.txt"))
    assert CALLS == ["left.double", "add", "square", "parity", "page"]  # total 18: parity as before


def test_a_stage_the_data_does_not_need_is_skipped_and_passes_its_input_on(go, tmp_path):
    (tmp_path / "left.txt").write_text("0")
    (tmp_path / "right.txt").write_text("0")
    record = go(HEAD + "want: [squared]")
    assert "square" not in CALLS
    assert (tmp_path / "run" / "out" / "squared.txt").read_text() == "0"
    square = next(stage for stage in record["stages"] if stage["name"] == "square")
    assert (square["status"], square["reason"]) == ("left_out", "the total is zero")
    assert status(go(HEAD + "want: [squared]"))["square"] == "left_out"
    assert status(go(HEAD + "want: [squared]", force_all=True))["square"] == "ran"
    assert CALLS == ["left.double", "right.double", "add", "square"]


def test_a_failure_keeps_the_partial_result_and_still_makes_the_page(go, tmp_path):
    go(ALL)
    with pytest.raises(ComputationError, match="sum diverged") as caught:
        go(ALL, ["add.fail=true"])
    assert caught.value.where == "stage add"
    out = tmp_path / "run" / "out"
    assert (out / "partial" / "total.txt").read_text() == "-1"
    assert not (out / "squared.txt").exists()  # the last run's: it would stand beside another run's record
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    assert status(record)["add"] == "failed"
    assert status(record)["square"] == "planned"
    page = json.loads((out / "page.json").read_text())
    assert (page["values"]["total"], page["statuses"]["add"]) == (-1, "failed")
    go(ALL)
    assert not (out / "partial").exists()
    assert CALLS == ["page"]


def test_an_unreadable_input_names_its_file(go, tmp_path):
    (tmp_path / "left.txt").write_text("three")
    with pytest.raises(InputError, match="not a number: 'three'") as caught:
        go(ALL)
    assert caught.value.where.endswith("left.txt")


def test_folders_that_are_not_a_run_are_refused(go, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "thesis.txt").write_text("do not touch")
    with pytest.raises(ConfigError, match="the folder is not empty and holds no run"):
        go(ALL)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["thesis.txt"]


def test_an_input_inside_the_run_is_refused(go, tmp_path):
    go(ALL)
    with pytest.raises(ConfigError, match="lies in the run's own folder"):
        go("schema: 1\ngiven: {left: {number: run/out/total.txt}}\nwant: [total]")


def test_artifacts_of_an_earlier_plan_do_not_stay_in_out(go, tmp_path):
    go(ALL)
    go(HEAD + "want: [total]")
    assert sorted(path.name for path in (tmp_path / "run" / "out").iterdir()) == [
        "left_doubled.txt",
        "right_doubled.txt",
        "total.preview",
        "total.txt",
    ]


def test_out_is_repaired_from_the_cache(go, tmp_path):
    go(ALL)
    (tmp_path / "run" / "out" / "squared.txt").write_text("garbage")
    (tmp_path / "run" / "out" / "label.txt").unlink()
    go(ALL)
    assert CALLS == ["page"]
    assert (tmp_path / "run" / "out" / "squared.txt").read_text() == "196"
    assert (tmp_path / "run" / "out" / "label.txt").read_text() == "11"


def test_a_truncated_result_is_made_again(go, tmp_path):
    go(ALL)
    (path,) = (tmp_path / "run" / "cache" / "square").glob("*/squared.txt")
    path.write_text("19")
    go(ALL)
    assert CALLS == ["square", "page"]
    assert (tmp_path / "run" / "out" / "squared.txt").read_text() == "196"


def test_the_page_can_be_made_again_without_the_inputs(go, tmp_path):
    go(ALL)
    page = tmp_path / "run" / "out" / "page.json"
    before = json.loads(page.read_text())
    page.unlink()
    (tmp_path / "left.txt").unlink()
    assert make_finals_again(tmp_path / "run", TOY) == [page]
    after = json.loads(page.read_text())
    assert after["values"] == {"total": 14, "label": 11}
    assert after["statuses"] == before["statuses"] | {"page": "ran"}
    with pytest.raises(InputError, match=r"it has no run.json"):
        make_finals_again(tmp_path, TOY)


KILLED = """
import os, signal, sys
sys.path.insert(0, {tests!r})
import vto_pipeline.pipeline.execution.store as store
from pathlib import Path
from toy_tables import TOY
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import read_request
from vto_pipeline.pipeline.execution.run import run

calls = 0
def dying(real):
    def call(*args, **kwargs):
        global calls
        calls += 1
        if calls == {moment}:
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*args, **kwargs)
    return call
store.os.replace = dying(os.replace)  # every file and folder that is put in place goes through here
request = read_request(load_yaml(Path({document!r})), Path({base!r}), TOY)
run(request, make_plan(request, TOY), TOY, Path({run!r}))
"""


def _contents(folder: Path) -> dict[str, bytes]:
    """All files but the page, which tells what came from the cache."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != "page.json")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_killed_at_any_moment_the_next_run_goes_on(go, tmp_path):
    go(ALL)
    undisturbed = _contents(tmp_path / "run" / "out")
    survived, unfinished = set(), 0
    for moment in (1, 3, 7, 10, 12, 17, 22):
        folder = tmp_path / f"killed{moment}"
        names = {"tests": str(Path(__file__).parents[1]), "document": str(tmp_path / "toy.yaml"), "base": str(tmp_path)}
        script = KILLED.format(**names, moment=moment, run=str(folder))
        died = subprocess.run([sys.executable, "-c", script], check=False)
        assert died.returncode == -signal.SIGKILL
        survived.add(len(list((folder / "cache").glob("*/*/manifest.json"))))
        unfinished += len(list((folder / "cache").glob(".unfinished*")))
        again = subprocess.run([sys.executable, "-c", KILLED.format(**names, moment=0, run=str(folder))], check=False)
        assert again.returncode == 0
        assert _contents(folder / "out") == undisturbed
        assert not list((folder / "cache").glob(".unfinished*"))
    assert len(survived) > 3  # the moments really were different ones,
    assert unfinished > 3  # and some in the middle of a stage


def test_two_runs_in_one_folder_clash(go, tmp_path):
    go(ALL)
    hold = (
        "import fcntl, sys, os; f = open(sys.argv[1], 'r+'); fcntl.flock(f, fcntl.LOCK_EX); f.truncate(0);"
        "f.write(str(os.getpid())); f.flush(); print('held', flush=True); sys.stdin.read()"
    )
    lock = str(tmp_path / "run" / ".lock")
    other = subprocess.Popen([sys.executable, "-c", hold, lock], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert other.stdout is not None
    assert other.stdout.readline() == b"held\n"
    with pytest.raises(ConfigError, match=f"another run is using this folder \\(process {other.pid}\\)"):
        go(ALL)
    other.kill()
    other.communicate()
    go(ALL)  # a dead process holds nothing
    assert CALLS == ["page"]
    with locked_run_folder(tmp_path / "run"), pytest.raises(ConfigError, match="another run is using this folder"):
        go(ALL)
