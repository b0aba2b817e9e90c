"""Batches whose client, workers and scheduler are killed: what is done stays done, and the same command goes on."""

from __future__ import annotations

import json
import random
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from vto_pipeline.cli.main import main
from vto_pipeline.pipeline.batch.cluster import run_rows
from vto_pipeline.pipeline.batch.row import RowTask
from vto_pipeline.pipeline.execution import folder as folder_module
from vto_pipeline.pipeline.execution.folder import locked_run_folder

pytest.importorskip("distributed")
import distributed
import psutil  # distributed brings it along
from batch_processes import PATIENCE, done, expected, squares, wait, workers


def results() -> dict[Path, int]:
    """The finished results, by the number that a folder keeps for life."""
    return {path.parent: path.parent.stat().st_ino for path in Path("out/cache").glob("*/*/manifest.json")}


@pytest.mark.parametrize(("rows", "kills"), [(4, 2), pytest.param(9, 40, marks=pytest.mark.slow)])
def test_kills_of_workers_and_clients_lose_nothing(client, rows, kills):
    chance, kept, listed, killed = random.Random(5), {}, [], []
    while True:
        batch = client(rows, "--workers", "2")
        wait(lambda batch=batch: workers(batch) or batch.poll() is not None)
        while batch.poll() is None and len(killed) < kills:
            time.sleep(chance.uniform(0.0, 2.0))
            victim = chance.choice([*workers(batch), *workers(batch), batch]) if killed else batch
            with suppress(psutil.NoSuchProcess, ProcessLookupError):
                below = psutil.Process(victim.pid).children(recursive=True)
                victim.send_signal(signal.SIGKILL)
                killed.append(victim)
                assert not psutil.wait_procs(below, PATIENCE)[1]
        said = batch.communicate()[0]
        assert kept.items() <= results().items()  # not made again
        assert set(listed) <= set(done())
        kept, listed = results(), done()
        if batch.returncode == 0:
            break
        assert batch.returncode in (-signal.SIGKILL, 6), said
    assert killed
    assert squares(rows) == expected(rows)


def test_a_scheduler_that_dies_while_a_result_is_on_its_way_is_told(cluster, tmp_path, monkeypatch):
    address, (scheduler, *_) = cluster
    fetch = distributed.Future.result

    def fetch_from_the_dead(future, *arguments):
        scheduler.kill()
        scheduler.wait(PATIENCE)
        return fetch(future, *arguments)

    monkeypatch.setattr(distributed.Future, "result", fetch_from_the_dead)
    command = (sys.executable, "-c", "pass")
    base = str(tmp_path)
    tasks = [RowTask(name, name, command, f"{base}/{name}", f"{base}/{name}.log", 1, 60.0, 1e3, 0) for name in "ab"]
    became = list(run_rows(tasks, 1, address, tmp_path))
    assert {(row.status, row.problem) for row in became} == {("lost", "the scheduler is gone")}


def test_two_machines_do_a_batch_and_a_scheduler_that_dies_is_told(client, cluster, gate):
    address, (scheduler, *_) = cluster
    gate.touch()
    batch = client(4, "--scheduler", address)
    wait(lambda: done() or batch.poll() is not None)
    scheduler.kill()
    said = batch.communicate()[0]
    assert batch.returncode == 6, said
    assert "the scheduler is gone" in said
    assert "Traceback" not in said
    gate.unlink()
    kept, listed = results(), done()  # what the workers had begun ends there meanwhile, and its folders become free
    assert 0 < len(listed) < 4
    again = client(4)
    said = again.communicate()[0]
    assert again.returncode == 0, said
    assert f"{len(listed)} of 4 rows are done and unchanged" in said
    assert kept.items() <= results().items()
    assert squares(4) == expected(4)


@pytest.mark.slow  # a scheduler waits long before it gives a machine up
def test_a_machine_that_dies_takes_no_row_with_it(client, cluster, gate):
    address, (_, machine, _) = cluster
    gate.touch()
    batch = client(4, "--scheduler", address)
    wait(lambda: done() or batch.poll() is not None)
    kept = results()
    for process in [psutil.Process(machine.pid), *psutil.Process(machine.pid).children(recursive=True)]:
        with suppress(psutil.NoSuchProcess):
            process.kill()
    gate.unlink()
    said = batch.communicate()[0]
    assert batch.returncode == 0, said
    assert "Traceback" not in said
    assert kept.items() <= results().items()
    assert squares(4) == expected(4)


def test_a_batch_that_is_cancelled_ends_and_is_resumed(client, gate, capfd):
    gate.touch()
    batch = client(3, "--workers", "1")
    wait(lambda: done() or batch.poll() is not None)
    below = psutil.Process(batch.pid).children(recursive=True)
    assert main(["cancel", "out", "--wait", str(PATIENCE), "--json"]) == 0
    said = batch.communicate()[0]
    assert json.loads(capfd.readouterr().out) == {"cancelled": True, "process": batch.pid}
    assert batch.returncode == 130, said
    assert "interrupted; run the same command again to resume" in said.splitlines()
    assert "distributed" not in said  # nobody who cancels a batch has to read of its workers
    assert not psutil.wait_procs(below, PATIENCE)[1]
    listed = done()
    assert 0 < len(listed) < 3
    assert "waiting" in Path("out/page.html").read_text()
    assert main(["cancel", "out"]) == 0
    assert capfd.readouterr().out == "nothing is at work there\n"
    gate.unlink()
    again = client(3)
    said = again.communicate()[0]
    assert again.returncode == 0, said
    assert f"{len(listed)} of 3 rows are done and unchanged" in said
    assert squares(3) == expected(3)


def test_what_is_elsewhere_or_no_run_is_not_cancelled(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert main(["cancel", "."]) == 3
    with locked_run_folder(tmp_path / "run"):
        monkeypatch.setattr(folder_module, "gethostname", lambda: "another")
        assert main(["cancel", "run"]) == 2
    assert "the run is on another machine" in capfd.readouterr().err
