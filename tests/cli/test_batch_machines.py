"""A batch on two machines that share one folder and nothing else: each has its own name, disk and temporary files."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
from batch_processes import CLIENT, HELD, ORDER, ROW, expected

pytest.importorskip("distributed")

MODULE = [sys.executable, "-m"]
MACHINE = """\
set -e
hostname {name}
mount -t tmpfs none {private}
mkdir {private}/own
export TMPDIR={private}/own
cd {private}/own
exec {worker}
"""
"""What is a machine's own hides what is the client's, at the same place."""
PATIENCE = 120.0  # s
ROWS = 6


@pytest.fixture
def scheduler(tmp_path) -> Iterator[str]:
    """The address of a scheduler with two machines, `one` and `other`, to which only tmp_path/shared is known."""
    for name in ("shared", "client"):
        (tmp_path / name).mkdir()
    can = shutil.which("unshare") and subprocess.run(["unshare", "--mount", "--uts", "true"], capture_output=True)
    if not can or can.returncode != 0:
        pytest.skip("no machine can be played here: it takes unshare (util-linux), as root")
    file = tmp_path / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    command = ["distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    started = [subprocess.Popen([*MODULE, *command], cwd=tmp_path, **quiet)]
    began = time.monotonic()
    while not (file.is_file() and file.read_text().endswith("}")):
        assert time.monotonic() - began < PATIENCE
        time.sleep(0.1)
    address = json.loads(file.read_text())["address"]
    worker = [*MODULE, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    for name in ("one", "other"):
        script = MACHINE.format(name=name, private=tmp_path / "client", worker=" ".join(worker))
        command = ["unshare", "--mount", "--uts", "sh", "-c", script]
        started.append(subprocess.Popen(command, cwd=tmp_path, **quiet))
    yield address
    for process in reversed(started):
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE / 4)
        process.kill()
        process.wait()


def test_two_machines_do_a_batch_that_knows_nothing_of_them(scheduler, tmp_path) -> None:
    shared, client = tmp_path / "shared", tmp_path / "client"
    for name, number in (("left.txt", "3"), ("right.txt", "4")):
        (shared / name).write_text(number)
    order = shared / "order.yaml"
    order.write_text(ORDER.format(offsets=list(range(1, ROWS + 1))))
    row = HELD.format(gate=str(shared / "gate")) + ROW
    command = [sys.executable, "-c", CLIENT.format(row=row), "batch", str(order), "--scheduler", scheduler]
    quiet = {"capture_output": True, "text": True, "cwd": client}
    said = subprocess.run([*command, "-o", str(shared / "far")], **quiet)
    assert said.returncode == 0, said.stdout + said.stderr
    squares = [path.read_text() for path in sorted((shared / "far").glob("rows/*/out/squared.txt"))]
    assert squares == expected(ROWS)
    hosts = {path.read_text().split()[1] for path in (shared / "far").glob("rows/*/.lock")}
    assert hosts == {"one", "other"}
    assert len(list((shared / "far/cache/left.double").glob("*/manifest.json"))) == 1  # the rows of both need it
    assert os.listdir(client) == []

    command[-2:] = ["--workers", "2"]  # the same batch here: the same bytes
    said = subprocess.run([*command, "-o", str(shared / "here")], **quiet)
    assert said.returncode == 0, said.stdout + said.stderr
    far, here = (sorted(path for path in (shared / name).glob("rows/*/out/*.txt")) for name in ("far", "here"))
    assert [path.read_bytes() for path in far] == [path.read_bytes() for path in here]
