"""Network folders that stop answering: each command says so and ends, whatever it was to read or to write there."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from stalled_folder import StalledFolder, stalled_folder

from vto_pipeline.io import stalls

TESTS = str(Path(__file__).parents[1])
DOCUMENT = b"schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared]\n"
ORDER = b"schema: 1\nrun: toy.yaml\nevery: {stages.add.offset: [1, 2]}\n"


@pytest.fixture
def nas(tmp_path, monkeypatch) -> Iterator[StalledFolder]:
    monkeypatch.setattr(stalls, "_PATIENCE", 1.0)
    monkeypatch.setattr(stalls, "_ANSWERED", set())
    files = {"left.txt": b"3", "toy.yaml": DOCUMENT, "order.yaml": ORDER}
    with stalled_folder(tmp_path / "nas", files) as folder:
        yield folder


def test_a_folder_that_answers_is_as_good_as_any(vto, nas):
    assert vto("run", "nas/toy.yaml", "-o", "run").code == 0
    assert Path("run/out/squared.txt").read_text() == "36"


@pytest.mark.parametrize(
    "command",
    [
        ("run", "nas/toy.yaml", "-o", "run"),
        ("run", "far.yaml", "-o", "run"),
        ("run", "toy.yaml", "-o", "nas/run"),
        ("run", "toy.yaml", "-o", "run", "--cache", "nas/cache"),
        ("run", "toy.yaml", "-o", "run", "--log", "nas/log.jsonl"),
        ("plan", "far.yaml"),
        ("batch", "nas/order.yaml", "-o", "batch"),
        ("batch", "far_order.yaml", "-o", "batch"),
        ("info", "nas/left.txt"),
        ("status", "nas"),
        ("prune", "nas"),
        ("report", "nas"),
        ("cancel", "nas"),
        ("bench", "--stale", "--out", "nas"),
    ],
    ids=" ".join,
)
def test_one_that_does_not_is_told(vto, nas, command):
    Path("far.yaml").write_text(DOCUMENT.decode().replace("left.txt", "nas/left.txt"))
    Path("far_order.yaml").write_text(ORDER.decode().replace("toy.yaml", "far.yaml"))
    nas.stall()
    said = vto(*command)
    assert said.code == 3, said.err
    assert f"no answer has come for 1 s\n  in {nas.path}" in said.err
    assert "is the disk or the network folder still there?" in said.err
    assert not Path("run").exists()


def has_ended(process):
    """Whether only threads are left that the kernel lets nobody end, as it does those that wait for FUSE."""
    return Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"


def test_the_process_ends_though_a_thread_of_it_waits_for_ever(nas):
    nas.stall()
    program = (
        f"import sys; sys.path.insert(0, {TESTS!r}); from vto_pipeline.io import stalls; stalls._PATIENCE = 1.0; "
        "from vto_pipeline.cli.main import main; sys.exit(main())"
    )
    command = [sys.executable, "-c", program, "info", str(nas.path / "left.txt")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert "no answer has come for 1 s" in process.stderr.readline()
        until = time.monotonic() + 20.0
        while not has_ended(process) and time.monotonic() < until:
            time.sleep(0.05)
        assert has_ended(process)
        nas.end()
        assert process.wait(20.0) == 3
