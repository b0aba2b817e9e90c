"""Schedulers whose workers never come, come late, or go: it is told, and the batch ends."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from vto_pipeline.pipeline.batch import cluster
from vto_pipeline.pipeline.batch.row import RowTask

pytest.importorskip("distributed")

PATIENCE = 120.0  # s, for a machine that is busy with other things
Start = Callable[..., "subprocess.Popen[bytes]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start a part of a cluster."""
    started = list[subprocess.Popen[bytes]]()

    def start(part: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{part}", *arguments, "--no-dashboard"]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        started.append(subprocess.Popen(command, cwd=tmp_path, **quiet))
        return started[-1]

    yield start
    for process in reversed(started):
        process.kill()
        process.wait(PATIENCE)


@pytest.fixture
def scheduler(start: Start, tmp_path: Path) -> str:
    """The address of one without workers."""
    file = tmp_path / "scheduler.json"
    start("scheduler", "--port", "0", "--scheduler-file", str(file))
    began = time.monotonic()
    while not (file.is_file() and file.read_text().endswith("}")):
        assert time.monotonic() - began < PATIENCE
        time.sleep(0.05)
    address: str = json.loads(file.read_text())["address"]
    return address


def tasks(folder: Path, *names: str, program: str = "pass") -> list[RowTask]:
    command = (sys.executable, "-c", program)
    return [RowTask(name, name, command, f"{folder}/{name}", f"{folder}/{name}.log", 1, 60.0, 1e3, 0) for name in names]


def test_a_scheduler_that_never_gets_a_worker_ends_the_batch(scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 3.0)
    told: list[str] = []
    began = time.monotonic()
    became = list(cluster.run_rows(tasks(tmp_path, *"abcdef"), 1, scheduler, tmp_path, told.append))
    assert time.monotonic() - began >= 3.0
    assert [row.name for row in became] == list("abcdef")
    assert {(row.status, row.problem) for row in became} == {("lost", "the scheduler has had no worker for 3 s")}
    (line,) = told
    assert f"waiting up to 3 s for one: `dask worker {scheduler}` starts it" in line


def test_a_worker_that_comes_late_runs_the_rows(scheduler, start, tmp_path):
    told: list[str] = []

    def say(line: str) -> None:
        told.append(line)
        start("worker", scheduler, "--nthreads", "1", "--no-nanny")

    became = list(cluster.run_rows(tasks(tmp_path, *"ab"), 1, scheduler, tmp_path, say))
    assert sorted((row.name, row.status) for row in became) == [("a", "done"), ("b", "done")]
    assert len(told) == 1


def test_workers_that_go_for_good_end_the_batch(scheduler, start, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 3.0)
    begun = tmp_path / "begun"
    worker = start("worker", scheduler, "--nthreads", "1", "--no-nanny")
    program = f"open({str(begun)!r}, 'w').close(); import time; time.sleep(60)"
    rows = cluster.run_rows(tasks(tmp_path, *"abc", program=program), 1, scheduler, tmp_path, lambda line: None)

    def go() -> None:
        began = time.monotonic()
        while not begun.exists():
            assert time.monotonic() - began < PATIENCE
            time.sleep(0.05)
        worker.kill()

    thread = threading.Thread(target=go)
    thread.start()
    became = list(rows)
    thread.join()
    assert {(row.status, row.problem) for row in became} == {("lost", "the scheduler has had no worker for 3 s")}
