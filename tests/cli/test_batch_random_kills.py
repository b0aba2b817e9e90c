"""Kills at random of every part of a batch while its rows are at work: what comes of it has the same bits."""

from __future__ import annotations

import json
import logging
import os
import pickle
import random
import shutil
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("distributed")
import psutil  # distributed brings it along
from batch_processes import PATIENCE, Cluster, done, expected, rows_of, squares, workers

from vto_pipeline.cli.commands.batch import PROGRAM

DATA = Path(__file__).parents[3] / "shared" / "data"
PAUSE = 20.0  # s: a drape takes as long
BOMB = [("", "a"), ("a", "b"), ("b", "c"), ("c", "measurements")]


def at_work(machines: list[subprocess.Popen[bytes]]) -> list[psutil.Process]:
    """The workers on some machines that run a row."""
    found = []
    for worker in [one for machine in machines for one in workers(machine)]:
        with suppress(psutil.NoSuchProcess):
            found += [worker] if worker.children() else []
    return found


def contents(batch: str) -> dict[str, bytes]:
    """All files that rows made but those that tell how long it took, or what came from the cache."""
    files = sorted(path for path in Path(batch).glob("rows/*/out/*") if path.is_file())
    timed = ("page.json", "trace.csv")
    return {str(path.relative_to(batch)): path.read_bytes() for path in files if path.name not in timed}


def strike(start: Callable[..., subprocess.Popen[str]], new_cluster: Callable[[], Cluster], pause: float) -> None:
    """Run a batch under random kills of workers, client and scheduler until it is whole; VTO_KILLS=65: 50, 10 and 5.

    All strike while rows are at work. The same command at once after each end, whatever is still at work. Where all
    rows have ended before all kills, another batch begins.

    Args:
        start: Arguments -> the command, which runs a batch in the folder out.
        new_cluster: Start a scheduler and workers.
        pause: Longest time between two kills [s].
    """
    kills, chance = int(os.environ.get("VTO_KILLS", "13")), random.Random(11)
    count = {"client": max(1, 10 * kills // 65), "scheduler": max(1, 5 * kills // 65)}
    plan = ["client"] * count["client"] + ["scheduler"] * count["scheduler"]
    plan += ["worker"] * (kills - len(plan))
    chance.shuffle(plan)
    victims, began, batches = iter(plan), time.monotonic(), 0
    next_victim, left = next(victims, None), kills
    address, processes = new_cluster()
    while True:
        batch = start("--scheduler", address)
        batches += 1
        while batch.poll() is None:
            time.sleep(chance.uniform(0.0, pause))
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
        if rows_of("out") and {row["status"] for row in rows_of("out")} <= {"done", "refused", "failed"}:
            if next_victim is None:
                break
            shutil.rmtree("out")
    seconds = time.monotonic() - began
    logging.info("%d kills (%s), the command %d times, %.0f s", len(plan), count, batches, seconds)


@pytest.mark.slow
def test_random_kills_of_every_part_change_no_bit(client, new_cluster):
    rows = max(6, int(os.environ.get("VTO_KILLS", "13")) // 3)
    strike(lambda *arguments: client(rows, *arguments), new_cluster, 2.0)
    assert squares(rows) == expected(rows)
    whole = client(rows, "-o", "whole", "--workers", "2")
    said = whole.communicate()[0]
    assert whole.returncode == 0, said
    assert contents("out") == contents("whole")


POISON = {
    "cut.ply": "a list claims 3 entries",
    "nan.obj": "1 of 3 vertices are not finite",
    "pickle.ply": "not a PLY file",
    "empty.ply": "the file is empty",
    "bomb.yaml": "YAML with more than 16 aliases is refused",
}
"""Name of a poisoned file -> what is said of its row."""


def write_drapes(count: int) -> None:
    """Write order.yaml: ten garments on three bodies and on seven tapes, as coarse as it goes, and five poisoned rows.

    Args:
        count: How many rows besides the poisoned ones, at most 100.
    """
    garments, bodies = sorted((DATA / "garments/berkeley").glob("*/*-iso.obj")), sorted((DATA / "bodies").glob("*.ply"))
    whole = (DATA / "garments/tshirt.ply").read_bytes()
    Path("cut.ply").write_bytes(whole[: len(whole) // 2])
    Path("nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    Path("pickle.ply").write_bytes(pickle.dumps({"vertices": 3}))
    Path("empty.ply").touch()
    lines = [f"{name}: &{name} [{', '.join(9 * [f'*{before}' if before else 'x'])}]" for before, name in BOMB]
    Path("bomb.yaml").write_text("\n".join(lines))
    tapes = [Path(f"tape_{stature}.yaml").absolute() for stature in range(158, 179, 3)]
    for path in tapes:
        stature = int(path.stem[5:])
        girths = f"bust_girth: {stature - 70}, waist_girth: {stature - 86}, hip_girth: {stature - 62}"
        path.write_text(f"unit: cm\nsex: female\nmeasurements: {{stature: {stature}, {girths}}}\n")
    customers = [("mesh", body) for body in bodies] + [("measurements", tape) for tape in tapes]
    rows = [
        {"given.garment.mesh": str(garment), f"given.body.{kind}": str(path)}
        for garment in garments
        for kind, path in customers
    ][:count]
    good = {"given.garment.mesh": str(garments[0]), "given.body.measurements": str(tapes[0])}
    for name in POISON:
        key = "given.body.measurements" if name == "bomb.yaml" else "given.garment.mesh"
        rows.append({"name": f"poison_{Path(name).stem}", **good, key: str(Path(name).absolute())})
    stages = {"simulation_mesh": {"edge_mm": 60.0}, "drape": {"target_error_mm": 20.0}}
    run = {"schema": 1, "given": {"fabric": "cotton_poplin"}, "want": ["draped"], "stages": stages}
    Path("order.yaml").write_text(json.dumps({"schema": 1, "run": run, "rows": rows}))


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.skipif(not DATA.is_dir(), reason="no real garments here")
def test_random_kills_change_no_bit_of_real_drapes_and_poisoned_rows_fail_alone(tmp_path, monkeypatch, new_cluster):
    """VTO_DRAPES=100 and VTO_KILLS=65 take hours."""
    monkeypatch.chdir(tmp_path)
    count = int(os.environ.get("VTO_DRAPES", "6"))
    write_drapes(count)

    def start(*arguments: str) -> subprocess.Popen[str]:
        command = [*PROGRAM, "batch", "order.yaml", *arguments]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    strike(lambda *arguments: start("-o", "out", *arguments), new_cluster, PAUSE)
    whole = start("-o", "whole", "--workers", "2")
    said = whole.communicate()[0]
    assert whole.returncode == 6, said
    assert contents("out") == contents("whole")
    found = rows_of("out")
    assert [(row["name"], row["status"]) for row in found] == [(row["name"], row["status"]) for row in rows_of("whole")]
    assert len(found) == count + len(POISON)
    problems = {row["name"].removeprefix("poison_"): row for row in found if row["name"].startswith("poison_")}
    for name, words in POISON.items():
        row = problems[Path(name).stem]
        assert (row["status"], words in row["problem"]) == ("refused", True), row
    logging.info("%d drapes: %s", count, Counter(row["status"] for row in found))
