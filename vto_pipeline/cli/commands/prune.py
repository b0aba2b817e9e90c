"""vto prune"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("prune")
@click.argument("folder", metavar="RUN|BATCH", type=PATH)
@click.option("--dry-run", is_flag=True, help="Only say what would be removed.")
@message_options
@pass_session
def prune_command(session: Session, folder: Path, dry_run: bool) -> None:
    """Remove the stored results of earlier settings, and keep those that the latest run, or the rows of a batch, used.

    What is in RUN/out stays as it is. No run may be at work in the folder.

    \b
    vto prune runs/shirt --dry-run
    """
    from vto_pipeline.errors import InputError
    from vto_pipeline.io.documents import read_json
    from vto_pipeline.pipeline.batch.ledger import LEDGER
    from vto_pipeline.pipeline.execution.folder import RECORD, locked_run_folder
    from vto_pipeline.pipeline.execution.store import Store

    if (folder / LEDGER).is_file():
        records = sorted(folder.glob(f"rows/*/{RECORD}"))
    elif (folder / RECORD).is_file():
        records = [folder / RECORD]
    else:
        raise InputError("neither the folder of a run nor of a batch", where=str(folder))
    with locked_run_folder(folder):
        used = {(stage["name"], stage["key"]) for record in records for stage in read_json(record)["stages"]}
        store = Store(folder / "cache")
        store.sweep()
        count, size = store.remove_others(used, dry_run=dry_run)
    word = "would be removed" if dry_run else "removed"
    session.answer(
        {"results": count, "bytes": size, "removed": not dry_run}, [f"{count} results {word}, {size / 1e6:.1f} MB"]
    )
