"""vto info"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session

_SIDES = ("size_m", "pixels")
_SMALL = 0.01
"""Below it three digits are told, not three places: a fabric's bending rigidity is some 1e-5 N·m."""


@click.command("info")
@click.argument("path", metavar="PATH", type=PATH)
@message_options
@pass_session
def info_command(session: Session, path: Path) -> None:
    """Describe a run, or a file or folder that may be given: its kind, its size in metres, what it holds.

    \b
    vto info runs/demo
    vto info shirt.obj
    """
    from vto_pipeline.cli.commands.status import status_command
    from vto_pipeline.cli.describe import DESCRIPTIONS
    from vto_pipeline.cli.results import outcome_lines, result_lines
    from vto_pipeline.cli.tables import table_lines
    from vto_pipeline.io.sniff import find_kind
    from vto_pipeline.model.job import Job
    from vto_pipeline.pipeline.batch.ledger import LEDGER
    from vto_pipeline.pipeline.execution.folder import is_run
    from vto_pipeline.stages.entry.outcome import open_run

    if (path / LEDGER).is_file():
        click.get_current_context().invoke(status_command, batch=path)
        return
    if path.is_dir() and is_run(path):
        outcome = open_run(path)
        failed = [
            f"FAILED in {stage['name']}: {stage['reason']}"
            for stage in outcome.record["stages"]
            if stage["status"] == "failed"
        ]
        lines = [*outcome_lines(outcome), *failed, *result_lines(outcome)]
        session.answer({**outcome.record, "run": str(path)}, lines)
        return
    kind, reason = find_kind(path)
    job = Job()
    facts = DESCRIPTIONS[kind](path, job)
    data = {"path": str(path), "kind": kind, "because": reason, **facts, "notes": job.notes, "warnings": job.warnings}
    rows = [(key.replace("_", " "), _text(key, value)) for key, value in facts.items()]
    lines = [f"{path}: {kind}, because {reason}", *table_lines(("", ""), rows)[2:]]
    session.answer(data, [*lines, *job.notes, *(f"warning: {text}" for text in job.warnings)])


def _text(key: str, value: Any) -> str:
    if isinstance(value, list):
        return (" x " if key in _SIDES else ", ").join(_text(key, item) for item in value)
    if isinstance(value, float):
        return f"{value:.3f}" if abs(value) >= _SMALL or value == 0.0 else f"{value:.3g}"
    return str(value)
