"""vto plan"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options, set_option
from vto_pipeline.cli.session import Session, pass_session


@click.command("plan")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@set_option
@message_options
@pass_session
def plan_command(session: Session, document: Path, overrides: tuple[str, ...]) -> None:
    """Show which stages a document would run and which it leaves out, with the reason. Nothing is run.

    \b
    vto plan configs/demo.yaml
    vto plan configs/demo.yaml --json
    """
    from vto_pipeline.cli.tables import plan_lines
    from vto_pipeline.cli.work import catalogue, planned

    request, plan = planned(document, overrides, catalogue())
    data = {
        "given": {artifact: one.key for artifact, one in request.given.items()},
        "want": list(request.want),
        "stages": [
            {
                "name": step.stage.name,
                "takes": list(step.inputs),
                "makes": list(step.stage.makes),
                "settings": step.settings.model_dump(mode="json"),
            }
            for step in plan.steps
        ],
        "left_out": [{"name": name, "reason": reason} for name, reason in plan.left_out.items()],
    }
    session.answer(data, plan_lines(request, plan))
