"""vto report"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("report")
@click.argument("folder", metavar="RUN", type=PATH)
@message_options
@pass_session
def report_command(session: Session, folder: Path) -> None:
    """Rebuild the page of a run from RUN/out. This works for a failed run too."""
    from vto_pipeline.pipeline.execution.final import make_finals_again
    from vto_pipeline.stages.entry.planning import catalogue, run_tables

    written = [str(path) for path in make_finals_again(folder, run_tables(folder, catalogue()))]
    session.answer({"written": written}, written)
