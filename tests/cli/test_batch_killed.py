"""Batches whose client, workers and scheduler are killed: what is done stays done, and the same command goes on."""

from __future__ import annotations

import json
import logging
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from vto_pipeline.cli.main import main
from vto_pipeline.pipeline.batch.cluster import run_rows
from vto_pipeline.pipeline.batch.ledger import LEDGER, read_ledger
from vto_pipeline.pipeline.batch.row import RowTask
from vto_pipeline.pipeline.execution import folder as folder_module
from vto_pipeline.pipeline.execution.folder import locked_run_folder

pytest.importorskip("distributed")
import distributed
import psutil  # distributed brings it along

TESTS = str(Path(__file__).parents[1])
ROW = (
    f"import sys; sys.path.insert(0, {TESTS!r}); from toy_tables import TOY; "
    "from vto_pipeline.stages.entry import planning; planning.catalogue = lambda: TOY; "
    "from vto_pipeline.cli.main import main; sys.exit(main())"
)
CLIENT = (
    "from vto_pipeline.cli.commands import batch; import sys; batch.PROGRAM = (sys.executable, '-c', {row!r}); " + ROW
)
HELD = (
    "import sys, time; from pathlib import Path; "
    "any(time.sleep(0.05) for _ in iter(lambda: Path({gate!r}).exists() and 'row_1' not in str(sys.argv), False)); "
)
"""All rows but the first wait for as long as there is a gate, so that no test depends on how fast they are."""
ORDER = """\
schema: 1
run:
  schema: 1
  given: {{left: {{number: left.txt}}, right: {{number: right.txt}}}}
  want: [squared, page]
every: {{stages.add.offset: {offsets}}}
"""
PATIENCE = 120.0  # s, for a machine that is busy with other things


@pytest.fixture
def gate(tmp_path) -> Path:
    """Where a file holds all rows but the first."""
    return tmp_path / "gate"


@pytest.fixture
def client(tmp_path, gate, monkeypatch) -> Callable[..., subprocess.Popen[str]]:
    """Start `vto batch` on the toy tables, with a row for each offset from 1."""
    monkeypatch.chdir(tmp_path)
    Path("left.txt").write_text("3")
    Path("right.txt").write_text("4")

    def start(rows: int, *arguments: str) -> subprocess.Popen[str]:
        Path("order.yaml").write_text(ORDER.format(offsets=list(range(1, rows + 1))))
        row = HELD.format(gate=str(gate)) + ROW
        command = [sys.executable, "-c", CLIENT.format(row=row), "batch", "order.yaml", "-o", "out", *arguments]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    return start


Cluster = tuple[str, list[subprocess.Popen[bytes]]]


@pytest.fixture
def new_cluster(tmp_path) -> Iterator[Callable[[], Cluster]]:
    """Start a scheduler and two workers, each in a folder of its own, as on two machines: address and processes."""
    module, started = [sys.executable, "-m"], list[subprocess.Popen[bytes]]()
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def start(*arguments: str, cwd: Path) -> subprocess.Popen[bytes]:
        started.append(subprocess.Popen([*module, *arguments, "--no-dashboard"], cwd=cwd, **quiet))
        return started[-1]

    def new() -> Cluster:
        for process in started[:-3]:  # those before the last cluster; what is left of that may still be at work
            process.kill()
        base = tmp_path / f"cluster{len(started)}"
        (base / "one").mkdir(parents=True)
        (base / "other").mkdir()
        file = str(base / "scheduler.json")
        processes = [start("distributed.cli.dask_scheduler", "--port", "0", "--scheduler-file", file, cwd=base)]
        options = ["distributed.cli.dask_worker", "--scheduler-file", file, "--nthreads", "1"]
        processes += [start(*options, cwd=base / name) for name in ("one", "other")]
        wait(lambda: Path(file).is_file() and Path(file).read_text().endswith("}"))
        return json.loads(Path(file).read_text())["address"], processes

    yield new
    for process in reversed(started):
        process.terminate()
    for process in reversed(started):
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE / 4)
        process.kill()
        process.wait(PATIENCE)


@pytest.fixture
def cluster(new_cluster) -> Cluster:
    """One of them."""
    return new_cluster()


def wait(ready: Callable[[], object]) -> None:
    """Wait until something is so."""
    began = time.monotonic()
    while not ready():
        assert time.monotonic() - began < PATIENCE
        time.sleep(0.05)


def done() -> list[str]:
    rows = read_ledger(Path("out"))["rows"] if Path("out", LEDGER).is_file() else []
    return [row["name"] for row in rows if row["status"] == "done"]


def results() -> dict[Path, int]:
    """The finished results, by the number that a folder keeps for life."""
    return {path.parent: path.parent.stat().st_ino for path in Path("out/cache").glob("*/*/manifest.json")}


def squares(rows: int) -> list[str]:
    digits = len(str(rows))  # names are padded, so that they sort
    names = [f"row_{offset:0{digits}d}" for offset in range(1, rows + 1)]
    return [Path(f"out/rows/{name}/out/squared.txt").read_text() for name in names]


def expected(rows: int) -> list[str]:
    return [str((2 * 3 + 2 * 4 + offset) ** 2) for offset in range(1, rows + 1)]


def workers(process: subprocess.Popen[str]) -> list[psutil.Process]:
    with suppress(psutil.NoSuchProcess):
        return [child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(child.cmdline())]
    return []


def at_work(machines: list[subprocess.Popen[bytes]]) -> list[psutil.Process]:
    """The workers on some machines that run a row."""
    found = []
    for worker in [one for machine in machines for one in workers(machine)]:
        with suppress(psutil.NoSuchProcess):
            found += [worker] if worker.children() else []
    return found


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


def contents(batch: str) -> dict[str, bytes]:
    """All files that rows made but their pages, which tell what came from the cache."""
    files = sorted(path for path in Path(batch).glob("rows/*/out/*") if path.name != "page.json")
    return {str(path.relative_to(batch)): path.read_bytes() for path in files}


@pytest.mark.slow
def test_random_kills_of_every_part_change_no_bit(client, new_cluster):
    """The same command at once after each end, whatever is still at work; VTO_KILLS=65 is 50, 10 and 5 in 21 rows.

    All strike while rows are at work. Where all rows are done before all kills, another batch begins.
    """
    kills = int(os.environ.get("VTO_KILLS", "13"))
    rows, chance = max(6, kills // 3), random.Random(11)
    count = {"client": max(1, 10 * kills // 65), "scheduler": max(1, 5 * kills // 65)}
    plan = ["client"] * count["client"] + ["scheduler"] * count["scheduler"]
    plan += ["worker"] * (kills - len(plan))
    chance.shuffle(plan)
    victims, began, batches = iter(plan), time.monotonic(), 0
    next_victim, left = next(victims, None), kills
    address, processes = new_cluster()
    while True:
        batch = client(rows, "--scheduler", address)
        batches += 1
        while batch.poll() is None:
            time.sleep(chance.uniform(0.0, 2.0))
            if any(machine.poll() is not None for machine in processes[1:]):  # a worker killed while it starts takes
                processes[0].kill()  # its machine along: begin with new ones
                batch.wait(PATIENCE)
                address, processes = new_cluster()
            busy = at_work(processes[1:])
            if next_victim is None or not busy:
                continue
            with suppress(psutil.NoSuchProcess):
                if next_victim == "worker":
                    chance.choice(busy).kill()
                else:
                    (batch if next_victim == "client" else processes[0]).kill()
                if next_victim == "scheduler":
                    batch.wait(PATIENCE)
                    address, processes = new_cluster()
                next_victim = next(victims, None)
                left -= 1
        said = batch.communicate()[0]
        logging.info("ended with %d, %d rows done; %d kills left", batch.returncode, len(done()), left)
        refused = batch.returncode == 2 and "no scheduler answers" in said  # it died while it was called
        assert refused or batch.returncode in (0, 6, -signal.SIGKILL), said
        assert "Traceback" not in said
        if batch.returncode == 0 and next_victim is None:
            break
        if batch.returncode == 0:
            assert squares(rows) == expected(rows)
            shutil.rmtree("out")
    assert squares(rows) == expected(rows)
    whole = client(rows, "-o", "whole", "--workers", "2")
    said = whole.communicate()[0]
    assert whole.returncode == 0, said
    assert contents("out") == contents("whole")
    seconds = time.monotonic() - began
    logging.info("%d rows, %d kills (%s), the command %d times, %.0f s", rows, len(plan), count, batches, seconds)


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
