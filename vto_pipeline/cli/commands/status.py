"""vto status"""

from __future__ import annotations

from pathlib import Path

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
    from vto_pipeline.pipeline.batch.summary import failure_lines

    found = read_ledger(batch)
    rows = [
        (
            row["name"],
            row["status"],
            f"{row['seconds']:.1f}" if "seconds" in row else "",
            row["problem"] or row["result"],
        )
        for row in found["rows"]
    ]
    counts = ", ".join(f"{count} {status}" for status, count in sorted(found["counts"].items()))
    lines = [f"{len(rows)} rows: {counts}", *failure_lines(found["failures"])]
    session.answer(found, [*lines, *table_lines(("row", "status", "s", "result"), rows)])
