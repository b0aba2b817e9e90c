"""What a batch costs besides its rows: those that watch them, and those whose results are all stored."""

from __future__ import annotations

import logging
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from toy_tables import CALLS, TOY

from vto_pipeline.pipeline.batch.cluster import run_rows
from vto_pipeline.pipeline.batch.order import Row
from vto_pipeline.pipeline.batch.row import RowTask, _Group
from vto_pipeline.pipeline.execution.record import RunRecord
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.batches import finish_stored

BUSY = 0.03  # share of a core that watching one row may take
LONG = 20.0  # s
HOLDS = "import time; held = bytearray(100_000_000); time.sleep(60)"
STARTS = f"subprocess.run([sys.executable, '-c', {HOLDS!r}])"
PARENT = f"import subprocess, sys, time; print(flush=True); time.sleep(1.0); {STARTS}"


def test_what_a_row_starts_later_counts_too() -> None:
    if not Path("/proc/self/stat").exists():
        pytest.skip("the system does not tell the memory of processes")
    command = [sys.executable, "-c", PARENT]
    with subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()  # until it has begun it counts as a copy of this process
        group, beside = _Group(process.pid), _Group(process.pid + 1_000_000)
        seen, began = [], time.monotonic()
        while not seen or (seen[-1] < 100.0 and time.monotonic() - began < 60.0):
            seen.append(group.resident_mb())
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        while group.resident_mb() > 0.0 and time.monotonic() - began < 120.0:
            time.sleep(0.1)  # the other may end later
        assert 0.0 < seen[0] < 100.0  # a Python, before it starts the other
        assert seen[-1] >= 100.0
        assert group.resident_mb() == beside.resident_mb() == 0.0


def children_s() -> float:
    """Processor time of all processes that this one has started and that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    own = resource.getrusage(resource.RUSAGE_SELF)  # the scheduler runs here
    return used.ru_utime + used.ru_stime + own.ru_utime + own.ru_stime


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of dask and its worker processes
def test_watching_rows_takes_next_to_nothing_of_the_cores_that_they_want(tmp_path) -> None:
    pytest.importorskip("distributed")
    spent = []
    for seconds in (1.0, 1.0 + LONG):
        command, folder = ("sleep", f"{seconds:g}"), f"{tmp_path}/{seconds:g}"
        tasks = [RowTask(name, name, command, folder + name, f"{folder}.log", 1, 600.0, 1e3, 0) for name in "ab"]
        began = children_s()
        assert [row.status for row in run_rows(tasks, 2, None, tmp_path / "workers")] == ["done"] * 2
        spent.append(children_s() - began)
    share = (spent[1] - spent[0]) / LONG / 2
    logging.info("watching a row takes %.1f %% of a core", 100.0 * share)
    assert share < BUSY


def test_a_stored_row_is_recorded_when_it_begins_and_when_it_has_ended(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    (tmp_path / "left.txt").write_text("3")
    data = {"schema": 1, "given": {"left": {"number": str(tmp_path / "left.txt")}}, "want": ["squared", "page"]}
    row, store = Row("a", data, "here", tmp_path), Store(tmp_path / "cache")
    written, save = [], RunRecord.save
    monkeypatch.setattr(RunRecord, "save", lambda self: written.append(1) or save(self))
    first = finish_stored(row, tmp_path / "rows" / "a", store, False)
    assert first is not None
    assert len(written) > 4  # also after each stage that took its time
    written.clear()
    CALLS.clear()
    again = finish_stored(row, tmp_path / "rows" / "b", store, False)
    assert again is not None
    assert CALLS == ["page"]
    assert len(written) == 2
    assert {stage["name"]: stage["status"] for stage in again.record["stages"] if stage["name"] != "page"} == {
        stage["name"]: "cached" if stage["status"] == "ran" else stage["status"]
        for stage in first.record["stages"]
        if stage["name"] != "page"
    }
