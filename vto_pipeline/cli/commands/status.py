"""vto status"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("status")
@click.argument("batch", metavar="BATCH", type=PATH)
@message_options
@pass_session
def status_command(session: Session, batch: Path) -> None:
    """Show what has become of every row of a batch, running or ended."""
    from vto_pipeline.cli.tables import table_lines
    from vto_pipeline.pipeline.batch.ledger import read_ledger
    from vto_pipeline.pipeline.batch.summary import failure_lines, row_lines

    found = {**read_ledger(batch), "at_work": _at_work(batch)}
    rows = [
        (
            row["name"],
            row["status"],
            f"{row['seconds']:.1f}" if "seconds" in row else "",
            "\n".join(row_lines(row)),
        )
        for row in found["rows"]
    ]
    counts = ", ".join(f"{count} {status}" for status, count in sorted(found["counts"].items()))
    lines = [f"{len(rows)} rows: {counts}", *_state_lines(found), *failure_lines(found["failures"])]
    session.answer(found, [*lines, *table_lines(("row", "status", "s", "result"), rows)])


def _at_work(batch: Path) -> str:
    """Return the process that works in a batch's folder, and its machine; empty where there is none."""
    from vto_pipeline.pipeline.execution.folder import holder_of

    with suppress(OSError):  # a copy of a batch has no lock
        return holder_of(batch)
    return ""


def _state_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield whether anything works on the rows that wait."""
    if found["at_work"]:
        yield f"at work: process {found['at_work'].replace(' ', ' on ')}"
    elif "waiting" in found["counts"]:
        yield "nothing is at work there: the same command as before runs the rows that wait"
