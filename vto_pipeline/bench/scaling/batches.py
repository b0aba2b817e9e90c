"""Batches: what planning costs by the row, what a row costs whose results are all stored, and one that ends."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.timing import Timing, clocked
from vto_pipeline.errors import ComputationError
from vto_pipeline.io.documents import write_json
from vto_pipeline.pipeline.batch.ledger import Ledger
from vto_pipeline.pipeline.batch.order import read_order
from vto_pipeline.pipeline.batch.row import RowResult
from vto_pipeline.pipeline.execution.cost import Meter
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.stages.entry.batches import finish_stored, plan_rows

_GIRTHS = {"stature": 170, "bust_girth": 92, "waist_girth": 74, "hip_girth": 98}
_CUSTOMER = {"sex": "female", "unit": "cm", "measurements": _GIRTHS}
Result = TypeVar("Result")

_SHARED = 100  # rows with one customer's file


def batch_rows(count: int, stored: int, watch: Watch) -> Iterator[Row]:
    """Measure a batch of so many rows, of which so many are also finished from the store."""
    yield watch.row(f"batch {count}", "plan", {}, 0, partial(_plan, count))
    yield watch.row(f"batch {count}", "journal", {}, 0, partial(_journal, count))
    yield watch.row(f"batch {stored}", "rows from the store", {}, 0, partial(_from_store, stored))


def _order(folder: Path, count: int, given: str, want: str) -> Path:
    """Write a batch document of so many rows, of which each hundred share a customer; all customers are alike."""
    customers = -(-count // _SHARED)
    for number in range(customers):
        write_json(folder / f"customer_{number}.json", _CUSTOMER)
    rows = [f"row_{i},customer_{i % customers}.json" for i in range(count)]
    (folder / "rows.csv").write_text("\n".join(["name,given.body.measurements", *rows]) + "\n", encoding="utf-8")
    run = f"{{schema: 1, given: {{{given}}}, want: [{want}]}}"
    (folder / "batch.yaml").write_text(f"schema: 1\nrun: {run}\nrows: rows.csv\n", encoding="utf-8")
    return folder / "batch.yaml"


def _plan(count: int) -> Measured:
    """Return the time to read and plan all rows of drapes, and the largest memory of this process meanwhile."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "garment.ply").write_text("ply\n")  # planning reads its bytes, not its meaning
        order = _order(folder, count, "garment: {mesh: garment.ply}, fabric: denim", "draped, fit_report, page")
        meter = Meter()
        (planned, cpu), seconds = clocked(
            _with_cpu,
            lambda: plan_rows(read_order(order), Store(folder / "cache"), lambda name, key: False, False),
        )
        errors = {"rows": len(planned), "row_cpu_ms": 1e3 * cpu / count, "peak_mb": meter.peak_mb()}
    return Timing(seconds), errors


def _journal(count: int) -> Measured:
    """Return the time to enter the end of each row."""
    with TemporaryDirectory() as name:
        ledger = Ledger(Path(name), [f"row_{i}" for i in range(count)])
        ledger.save()

        def enter_all() -> None:
            for i in range(count):
                ledger.enter(RowResult(f"row_{i}", "key", "done", 0, 1.0, 1.0, 1), "it fits")

        (_, cpu), seconds = clocked(_with_cpu, enter_all)
    return Timing(seconds), {"row_cpu_ms": 1e3 * cpu / count}


def _from_store(count: int) -> Measured:
    """Return the time to finish rows whose avatar is stored, after the first has made it.

    Raises:
        ComputationError: one was not finished.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = read_order(_order(folder, count + 1, "", "avatar, measurements"))
        store = Store(folder / "cache")
        finish_stored(rows[0], folder / "rows" / rows[0].name, store, False)  # makes what the others find
        planned = plan_rows(rows[1:], store, lambda name, key: False, False)

        def finish() -> list[object]:
            return [finish_stored(one.row, folder / "rows" / one.row.name, store, False) for one in planned]

        (ended, cpu), seconds = clocked(_with_cpu, finish)
    if None in ended or not all(one.stored for one in planned):
        raise ComputationError("a row was not finished from the store")
    return Timing(seconds), {"row_cpu_ms": 1e3 * cpu / count}


def _with_cpu(work: Callable[[], Result]) -> tuple[Result, float]:
    """Return what work returns, and the processor time of this process [s], which other work on the machine spares."""
    began = time.process_time()
    return work(), time.process_time() - began
