"""`vto batch` on toy rows as a process, and schedulers with workers, for tests that kill them."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from vto_pipeline.pipeline.batch.ledger import LEDGER, read_ledger

if TYPE_CHECKING:
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


def rows_of(batch: str) -> list[dict[str, Any]]:
    """What has become of the rows of a batch; none before there is one."""
    return list(read_ledger(Path(batch))["rows"]) if Path(batch, LEDGER).is_file() else []


def done() -> list[str]:
    return [row["name"] for row in rows_of("out") if row["status"] == "done"]


def squares(rows: int) -> list[str]:
    digits = len(str(rows))  # names are padded, so that they sort
    names = [f"row_{offset:0{digits}d}" for offset in range(1, rows + 1)]
    return [Path(f"out/rows/{name}/out/squared.txt").read_text() for name in names]


def expected(rows: int) -> list[str]:
    return [str((2 * 3 + 2 * 4 + offset) ** 2) for offset in range(1, rows + 1)]


def workers(process: subprocess.Popen[Any]) -> list[psutil.Process]:
    import psutil

    with suppress(psutil.NoSuchProcess):
        return [child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(child.cmdline())]
    return []
