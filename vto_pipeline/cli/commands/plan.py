"""vto plan"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, force_option, message_options, output_option, set_option
from vto_pipeline.cli.session import Session, pass_session


@click.command("plan")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@output_option
@set_option
@force_option
@message_options
@pass_session
def plan_command(
    session: Session, document: Path, output: Path | None, overrides: tuple[str, ...], force_all: bool
) -> None:
    """Show which stages a document would run and which it leaves out, with the reason. Nothing is run.

    Results in the run's folder are named as stored; beside each other stage stands what it will take, by runs there.

    \b
    vto plan configs/demo.yaml
    vto plan configs/demo.yaml --json
    """
    from dataclasses import asdict

    from vto_pipeline.cli.tables import plan_lines
    from vto_pipeline.pipeline.execution.forecast import forecast
    from vto_pipeline.pipeline.execution.store import Store
    from vto_pipeline.stages.entry.planning import catalogue, planned

    request, plan = planned(document, overrides, catalogue())
    store = Store((output or Path("runs") / document.stem) / "cache")
    expected = forecast(request, plan, store, force_all)
    data = {
        "given": {artifact: one.key for artifact, one in request.given.items()},
        "want": list(request.want),
        "stages": [
            {
                "name": step.stage.name,
                "takes": list(step.inputs),
                "makes": list(step.stage.makes),
                "settings": step.settings.model_dump(mode="json"),
                "expected": asdict(expected[step.stage.name]),
            }
            for step in plan.steps
        ],
        "left_out": [{"name": name, "reason": reason} for name, reason in plan.left_out.items()],
    }
    session.answer(data, plan_lines(request, plan, expected, session.verbose))
