"""vto cancel"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session

_LOOK = 0.1  # s between looks at whether it has ended


@click.command("cancel")
@click.argument("folder", metavar="RUN|BATCH", type=PATH)
@click.option("--wait", type=click.FloatRange(0), default=60.0, show_default=True, help="For it to end [s].")
@message_options
@pass_session
def cancel_command(session: Session, folder: Path, wait: float) -> None:
    """End the run or batch at work in a folder. What it has finished stays, and the same command resumes it.

    It ends as by Ctrl-C, with exit code 130. Rows on the workers of another machine's scheduler run to their end.

    \b
    vto cancel batches/november
    """
    import os
    import signal
    import time
    from contextlib import suppress

    from vto_pipeline.errors import ConfigError
    from vto_pipeline.pipeline.execution.folder import process_in

    process = process_in(folder)
    if process is None:
        session.answer({"cancelled": False}, ["nothing is at work there"])
        return
    with suppress(ProcessLookupError):  # it has just ended
        os.kill(process, signal.SIGTERM)
    began = time.monotonic()
    while process_in(folder) == process:
        if time.monotonic() - began > wait:
            hint = f"wait with --wait, or kill -9 {process}: what is finished is safe"
            raise ConfigError(f"process {process} has not ended within {wait:g} s", where=str(folder), hint=hint)
        time.sleep(_LOOK)
    session.answer({"cancelled": True, "process": process}, ["it has ended; the command that began it resumes it"])
