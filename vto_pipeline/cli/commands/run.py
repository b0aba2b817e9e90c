"""vto run"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("run")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@click.option("--cache", type=PATH, metavar="DIR", help="Folder of results to share with other runs.")
@pipeline_options
@pass_session
def run_command(
    session: Session,
    document: Path,
    cache: Path | None,
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Run a pipeline document: make the wanted artifacts from the given inputs.

    Results of an earlier run in the same folder are reused if nothing they depend on has changed.
    Paths in the document are relative to the document's own folder.

    \b
    vto run configs/demo.yaml
    vto run configs/demo.yaml -o runs/fine --set drape.target_error_mm=0.2
    """
    from vto_pipeline.cli.work import catalogue, run_document
    from vto_pipeline.io.documents import load_yaml

    run_document(
        load_yaml(document),
        document.resolve().parent,
        output or Path("runs") / document.stem,
        overrides,
        force_all,
        session,
        catalogue(),
        cache,
    )
