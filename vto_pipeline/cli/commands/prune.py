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

    Copies of inputs from object stores that no row uses go, too. What is in RUN/out stays as it is. No run may be at
    work in the folder.

    \b
    vto prune runs/shirt --dry-run
    """
    from vto_pipeline.errors import InputError
    from vto_pipeline.io.documents import read_json
    from vto_pipeline.pipeline.batch.inputs import Inputs
    from vto_pipeline.pipeline.batch.ledger import LEDGER
    from vto_pipeline.pipeline.batch.order import strings_in
    from vto_pipeline.pipeline.batch.roots import ANYWHERE
    from vto_pipeline.pipeline.execution.folder import RECORD, locked_run_folder
    from vto_pipeline.pipeline.execution.store import Store

    if (folder / LEDGER).is_file():
        records = sorted(folder.glob(f"rows/*/{RECORD}"))
    elif (folder / RECORD).is_file():
        records = [folder / RECORD]
    else:
        raise InputError("neither the folder of a run nor of a batch", where=str(folder))
    with locked_run_folder(folder):
        found = [read_json(record) for record in records]
        used = {(stage["name"], stage["key"]) for record in found for stage in record["stages"]}
        store = Store(folder / "cache")
        store.sweep()
        count, size = store.remove_others(used, dry_run=dry_run)
        given = {text for record in found for text in strings_in(record["given"])}
        copies, more = Inputs(folder / "inputs", ANYWHERE).remove_others(given, dry_run=dry_run)
    told = {"results": count, "inputs": copies, "bytes": size + more, "removed": not dry_run}
    what = f"{count} results" + (f" and {copies} copies of inputs" if copies else "")
    word = "would be removed" if dry_run else "removed"
    session.answer(told, [f"{what} {word}, {told['bytes'] / 1e6:.1f} MB"])
