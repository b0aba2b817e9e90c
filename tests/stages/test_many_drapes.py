"""Many drapes in one process, as in a program that runs for days: memory, open files and threads stay as they were.

And many that are stored: what a row of a batch costs for which nothing is to be computed.
"""

from __future__ import annotations

import gc
import json
import logging
import os
import shutil
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline import api
from vto_pipeline.cli.main import main
from vto_pipeline.io.meshes import write_ply
from vto_pipeline.model.mesh import TriangleMesh

STORED, STORED_MS = 20, 50.0  # rows, and of processor time each
SETTLED = 10  # drapes after which all is loaded and all caches are full
GROWTH = 0.05
SETTINGS = {
    "simulation_mesh.edge_mm": 100.0,
    "drape.place": "as_it_stands",
    "drape.target_error_mm": 10.0,
    "drape.settle_seconds": 1.0,
}


def tube(below: float, above: float, low: float, high: float, around: int, along: int, capped: bool) -> TriangleMesh:
    """A tube about the vertical axis, with a radius at either end; capped, its ends are closed by fans."""
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    ring = np.column_stack([np.sin(angle), np.zeros(around), np.cos(angle)])
    levels = zip(np.linspace(low, high, along), np.linspace(below, above, along), strict=True)
    rings = [radius * ring + (0.0, y, 0.0) for y, radius in levels]
    first = np.arange(around * (along - 1))
    next_ = first - first % around + (first % around + 1) % around
    faces = [np.column_stack([first, next_, next_ + around]), np.column_stack([first, next_ + around, first + around])]
    vertices = [*rings, np.array([[0.0, low, 0.0], [0.0, high, 0.0]])] if capped else rings
    if capped:
        k, top, end = np.arange(around), around * (along - 1), around * along
        faces += [
            np.column_stack([(k + 1) % around, k, np.full(around, end)]),
            np.column_stack([top + k, top + (k + 1) % around, np.full(around, end + 1)]),
        ]
    return TriangleMesh(np.vstack(vertices), np.vstack(faces).astype(np.int32))


def held() -> tuple[float, int, int]:
    """Resident memory [MB], open files, and threads of this process."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6, len(os.listdir("/proc/self/fd")), threading.active_count()


@pytest.mark.slow
def test_memory_and_open_files_stay_the_same_over_many_drapes(tmp_path, monkeypatch):
    """Each made from its files to the page, in a folder of its own; VTO_DRAPES tells how many."""
    if not Path("/proc/self/statm").exists():
        pytest.skip("the system does not tell the memory of a process")
    monkeypatch.chdir(tmp_path)
    write_ply("body.ply", tube(0.25, 0.1, 0.0, 1.6, 20, 17, True))
    write_ply("skirt.ply", tube(0.22, 0.17, 0.6, 1.1, 14, 7, False))
    found: list[tuple[float, int, int]] = []
    for number in range(int(os.environ.get("VTO_DRAPES", "60"))):
        made = api.drape("skirt.ply", body="body.ply", output=f"run{number}", settings=SETTINGS)
        assert made.made("draped")
        assert made.path("page").is_file()
        shutil.rmtree(made.folder)
        found.append(held())
        logging.info("drape %d: %.1f MB, %d files, %d threads, %.1f s", number + 1, *found[-1], made.seconds)
    memory, files, threads = zip(*found, strict=True)
    assert max(memory[SETTLED:]) < (1.0 + GROWTH) * memory[SETTLED - 1]
    assert set(files[SETTLED:]) == {files[SETTLED - 1]}
    assert set(threads[SETTLED:]) == {threads[SETTLED - 1]}


@pytest.mark.slow
def test_a_row_whose_drape_is_stored_costs_little(tmp_path, monkeypatch, capfd):
    """By the command itself: its plan, its copies, its page, its line in the summary; the picture is there already."""
    pytest.importorskip("distributed")
    monkeypatch.chdir(tmp_path)
    write_ply("body.ply", tube(0.25, 0.1, 0.0, 1.6, 20, 17, True))
    write_ply("skirt.ply", tube(0.22, 0.17, 0.6, 1.1, 14, 7, False))
    run = {
        "schema": 1,
        "given": {"garment": {"mesh": "skirt.ply"}, "body": {"mesh": "body.ply"}, "fabric": "cotton_poplin"},
        "want": ["draped", "fit_report", "page"],
    }

    def do(count: int) -> tuple[int, float, str]:
        """Run the first rows of a batch: exit code, processor time of this process [s], and what was said."""
        changes = {f"stages.{name}": value for name, value in SETTINGS.items()}
        rows = [{"name": f"row_{k}", **changes} for k in range(count)]
        Path("order.yaml").write_text(json.dumps({"schema": 1, "run": run, "rows": rows}))
        began = time.process_time()
        code = main(["batch", "order.yaml", "-o", "batch", "--workers", "1"])
        return code, time.process_time() - began, capfd.readouterr().err

    assert do(1)[0] == 0
    assert do(2)[0] == 0  # loads what draws and writes pages
    seconds = []
    for count in (3, 3 + STORED):  # one row more, and then many
        code, spent, said = do(count)
        assert code == 0
        assert "had all their results stored" in said
        seconds.append(spent)
    row_ms = 1e3 * (seconds[1] - seconds[0]) / (STORED - 1)
    logging.info("a stored row takes %.0f ms of a processor; the batches took %s s", row_ms, seconds)
    assert 0.0 < row_ms < STORED_MS
