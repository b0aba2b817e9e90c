"""vto schema"""

from __future__ import annotations

import json

import click

from vto_pipeline.cli.options import message_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("schema")
@message_options
@pass_session
def schema_command(session: Session) -> None:
    """Print the JSON schema of a pipeline document, with every setting, its default, range and unit.

    \b
    vto schema > vto.schema.json
    """
    from vto_pipeline.stages.entry.planning import catalogue
    from vto_pipeline.stages.outfit import document_schema

    schema = document_schema(catalogue())
    session.answer(schema, [json.dumps(schema, indent=1, ensure_ascii=False)])
