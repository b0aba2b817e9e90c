"""vto batch"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vto_pipeline.cli.options import (
    PATH,
    Quantity,
    force_option,
    log_option,
    message_options,
    quiet_option,
    set_option,
)
from vto_pipeline.cli.session import Session, pass_session
from vto_pipeline.errors import BatchError, VtoError
from vto_pipeline.units import MEMORY_B, TIME_S

if TYPE_CHECKING:
    from vto_pipeline.pipeline.batch.ledger import Ledger
    from vto_pipeline.pipeline.batch.order import Row
    from vto_pipeline.pipeline.batch.publish import Publisher
    from vto_pipeline.pipeline.batch.row import RowTask
    from vto_pipeline.pipeline.execution.store import Store
    from vto_pipeline.stages.entry.batches import PlannedRow
    from vto_pipeline.stages.entry.outcome import Outcome

PROGRAM = (sys.executable, "-c", "import sys; from vto_pipeline.cli.main import main; sys.exit(main())")
"""What runs one row: this program once more, whatever is on the path."""


@click.command("batch")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@click.option("-o", "--output", type=PATH, metavar="BATCH", help="Folder of the batch. [default: runs/NAME]")
@click.option("--workers", type=click.IntRange(1, 1000), help="Rows at once. [default: one a core, as memory allows]")
@click.option("--scheduler", metavar="ADDRESS", help="Of a dask scheduler; its workers see the same folders.")
@click.option("--memory", type=Quantity(MEMORY_B), default="6GB", show_default=True, help="Limit of a row.")
@click.option("--time-limit", type=Quantity(TIME_S), default="1h", show_default=True, help="Limit of a row.")
@click.option("--retries", type=click.IntRange(0, 10), default=1, show_default=True, help="After a crash of a row.")
@click.option(
    "--root",
    multiple=True,
    metavar="FOLDER|ADDRESS",
    help="Refuse what lies in no such folder or address, for batches from strangers; may be repeated.",
)
@click.option(
    "--publish", metavar="ADDRESS", help="Copy what the rows make to an object store, such as s3://bucket/nov."
)
@set_option
@force_option
@log_option
@quiet_option
@message_options
@pass_session
def batch_command(
    session: Session,
    document: Path,
    output: Path | None,
    workers: int | None,
    scheduler: str | None,
    memory: float,
    time_limit: float,
    retries: int,
    root: tuple[str, ...],
    publish: str | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Run a pipeline document many times, each time with the changes of one row of a table.

    All rows are checked before the first one runs. What several rows need is made once. Rows that are done, and whose
    inputs have not changed, are not run again. Exit code 6: some rows failed; the others are whole.
    Given files may lie in object stores, as in s3://bucket/shirt.ply; each is copied here once.

    \b
    vto batch orders.yaml -o batches/november
    vto batch orders.yaml -o batches/november --publish s3://bucket/november
    vto status batches/november
    """
    from vto_pipeline.pipeline.batch.cluster import default_workers, run_rows
    from vto_pipeline.pipeline.batch.inputs import Inputs
    from vto_pipeline.pipeline.batch.ledger import LEDGER, Ledger, read_ledger
    from vto_pipeline.pipeline.batch.order import read_order
    from vto_pipeline.pipeline.batch.publish import Publisher
    from vto_pipeline.pipeline.batch.roots import Roots
    from vto_pipeline.pipeline.batch.summary import row_lines
    from vto_pipeline.pipeline.batch.time_left import TimeLeft
    from vto_pipeline.pipeline.execution.folder import locked_run_folder
    from vto_pipeline.pipeline.execution.store import Store
    from vto_pipeline.stages.entry.batches import plan_rows, with_settings
    from vto_pipeline.stages.entry.outcome import open_run

    roots = Roots(root)
    rows = with_settings(read_order(document, roots), overrides)
    folder = (output or Path("runs") / document.stem).absolute()
    inputs = Inputs(folder / "inputs", roots, session.say)
    if inputs.check(rows):
        with locked_run_folder(folder):
            rows = inputs.of_rows(rows)
    names, store = [row.name for row in rows], Store(folder / "cache")
    planned = plan_rows(rows, store, Ledger(folder, names).is_done, force_all, roots.with_folder(folder / "inputs"))
    with locked_run_folder(folder):
        ledger = Ledger(folder, names)
        publisher = Publisher(folder, publish) if publish else None
        missing = [one for one in planned if not ledger.is_done(one.row.name, one.key)]
        expected = {one.row.name: ledger.expected_seconds(one.row.name, one.key, one.seconds) for one in missing}
        missing.sort(key=lambda one: -expected[one.row.name])  # the longest first; stable
        if len(missing) < len(rows):
            session.say(f"{len(rows) - len(missing)} of {len(rows)} rows are done and unchanged")
        for one in missing:
            ledger.wait(one.row.name)
        ledger.save()
        if publisher:
            publisher.put([LEDGER])  # before hours of work: whether it can be written to
        try:
            missing = list(_finish_stored(session, missing, folder, store, force_all, ledger))
            count = workers or default_workers(memory / 1e6)
            limits = {"seconds": time_limit, "memory_mb": memory / 1e6, "retries": retries}
            tasks = [_task(one, folder, force_all, count, limits) for one in missing]
            results = run_rows(tasks, count, scheduler, folder / "workers", session.say) if tasks else ()
            left = TimeLeft({task.name: expected[task.name] for task in tasks}, count)
            if tasks and left.seconds() is not None:
                session.say(f"{len(tasks)} rows to run: about {left.seconds():.0f} s, by earlier runs")
            for done, result in enumerate(results, start=1):
                is_done = result.status == "done"
                words, shown = _shown(open_run(folder / "rows" / result.name), folder) if is_done else ("", {})
                ledger.enter(result, words, shown)
                left.ended(result.name)
                row = ledger.rows[result.name]
                said = {**asdict(result), "result": words, "warnings": row["warnings"]}
                session.enter("row", done=done, count=len(tasks), left_s=left.seconds(), **said)
                told = "; ".join(row_lines(row))
                session.say(
                    f"[{done}/{len(tasks)}] {result.name}: {result.status} after {result.seconds:.1f} s"
                    f"{': ' if told else ''}{told}; about {left.seconds() or 0.0:.0f} s left"
                )
                if publisher:
                    _publish_row(session, publisher, ledger.rows[result.name])
        finally:  # also where it is cancelled
            ledger.save()
            _write_tables(session, folder)
        if publisher:
            session.say(publisher.put_batch(read_ledger(folder)))
        _answer(session, folder, ledger)


def _publish_row(session: Session, publisher: Publisher, row: Mapping[str, Any]) -> None:
    """Copy what a row made to the store; where that fails, it is tried again at the end."""
    try:
        publisher.put_row(row)
    except VtoError as error:
        session.say(f"{row['name']} is not published yet: {error.problem}")


def _finish_stored(
    session: Session, rows: Iterable[PlannedRow], folder: Path, store: Store, force_all: bool, ledger: Ledger
) -> Iterator[PlannedRow]:
    """Finish the rows whose results are all stored, here; yield the others."""
    from vto_pipeline.pipeline.batch.row import RowResult
    from vto_pipeline.stages.entry.batches import finish_stored

    count = 0
    for one in rows:
        name, began = one.row.name, time.monotonic()
        outcome = finish_stored(one.row, folder / "rows" / name, store, force_all) if one.stored else None
        if outcome is None:
            yield one
            continue
        _write_document(one.row, folder)
        seconds = round(time.monotonic() - began, 3)
        result = RowResult(name, one.key, "done", 0, seconds, 0.0, 0)
        ledger.enter(result, *_shown(outcome, folder))
        count += 1
    if count:
        session.say(f"{count} rows had all their results stored")


def _write_document(row: Row, folder: Path) -> Path:
    from vto_pipeline.io.documents import write_json

    path = folder / "documents" / f"{row.name}.json"
    write_json(path, row.data)
    return path


def _task(planned: PlannedRow, folder: Path, force_all: bool, workers: int, limits: Mapping[str, Any]) -> RowTask:
    """Write the row's document, and return what a worker is to do with it."""
    from vto_pipeline.pipeline.batch.row import RowTask
    from vto_pipeline.pipeline.execution.cost import thread_count

    row = planned.row
    arguments = [
        "run",
        str(_write_document(row, folder)),
        "-o",
        str(folder / "rows" / row.name),
        "--cache",
        str(folder / "cache"),
        "--memory",
        f"{limits['memory_mb']:g}MB",
        "--json",
    ]
    return RowTask(
        name=row.name,
        key=planned.key,
        folder=str(folder / "rows" / row.name),
        command=(*PROGRAM, *arguments, *(["--force-all"] if force_all else [])),
        log=str(folder / "logs" / f"{row.name}.log"),
        threads=max(1, thread_count() // workers),
        **limits,
    )


def _shown(outcome: Outcome, folder: Path) -> tuple[str, dict[str, Any]]:
    """Return the verdicts of a run that has ended, what it warns of, and its page, picture and files in BATCH."""
    from vto_pipeline.stages.entry.pictures import draw_outcome

    files = [path.relative_to(folder).as_posix() for path in outcome.files]
    page = next((name for name in files if name.endswith("page.html")), "")
    warnings = "; ".join(f"{stage.replace('_', ' ')}: {text}" for stage, text in outcome.warnings)
    shown = {"warnings": warnings, "page": page, "picture": draw_outcome(outcome, folder), "files": files}
    return "; ".join(outcome.verdicts), shown


def _write_tables(session: Session, folder: Path) -> None:
    """Write the page and batch.parquet."""
    from vto_pipeline.io.files import replacing
    from vto_pipeline.pipeline.batch.ledger import read_ledger
    from vto_pipeline.pipeline.batch.summary import write_parquet
    from vto_pipeline.report.batch.page import build_batch_page

    batch = read_ledger(folder)
    with replacing(folder / "page.html") as beside:
        beside.write_text(build_batch_page(batch), encoding="utf-8")
    if not write_parquet(batch["rows"], folder / "batch.parquet"):
        session.say("no batch.parquet: it needs pyarrow")


def _answer(session: Session, folder: Path, ledger: Ledger) -> None:
    """Print the outcome.

    Raises:
        BatchError: not every row is done.
    """
    from vto_pipeline.pipeline.batch.ledger import read_ledger
    from vto_pipeline.pipeline.batch.summary import failure_lines, failures

    for line in failure_lines(failures(ledger.rows.values())):
        session.say(line)
    session.enter("done", batch=str(folder), counts=ledger.counts())
    done = ledger.counts().get("done", 0)
    if done < len(ledger.rows):
        others = ", ".join(f"{count} {status}" for status, count in sorted(ledger.counts().items()) if status != "done")
        raise BatchError(
            f"{len(ledger.rows) - done} of {len(ledger.rows)} rows are not done: {others}",
            where=str(folder),
            hint=f"`vto status {folder}` lists them; run the same command again to repeat them only",
        )
    doubtful = sum(bool(row["warnings"]) for row in ledger.rows.values())
    lines = [f"{done} rows are done{f', {doubtful} of them with warnings' if doubtful else ''}"]
    session.answer(read_ledger(folder), [*lines, f"  page  {folder / 'page.html'}"])
