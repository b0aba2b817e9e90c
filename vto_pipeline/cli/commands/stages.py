"""vto stages"""

from __future__ import annotations

import click

from vto_pipeline.cli.options import message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("stages")
@message_options
@pass_session
def stages_command(session: Session) -> None:
    """List all stages: what each does, needs and makes. With -v, their settings too."""
    from vto_pipeline.cli.tables import table_lines
    from vto_pipeline.stages.entry.planning import catalogue

    tables = catalogue()
    data = [
        {
            "name": stage.name,
            "about": stage.about,
            "needs": list(stage.needs),
            "optional": list(stage.optional),
            "makes": list(stage.makes),
            "uses": list(stage.uses),
            "settings": f"stages.{stage.section}",
        }
        for stage in tables.stages
    ]
    rows = [
        (s.name, s.about, ", ".join((*s.needs, *(f"[{a}]" for a in s.optional))), ", ".join(s.makes))
        for s in tables.stages
    ]
    lines = table_lines(("stage", "does", "needs [takes]", "makes"), rows)
    if session.verbose:
        settings = [
            (f"{section}.{name}", str(field.default), field.description or "")
            for section, kind in tables.sections.items()
            for name, field in kind.model_fields.items()
        ]
        lines += ["", *table_lines(("setting", "default", "is"), settings)]
    session.answer(data, lines)
