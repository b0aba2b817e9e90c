"""vto run"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, drape_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("run")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@click.option("--cache", type=PATH, metavar="DIR", help="Folder of results to share with other runs.")
@drape_options
@pass_session
def run_command(session: Session, document: Path, **options: Any) -> None:
    """Run a pipeline document: make the wanted artifacts from the given inputs.

    Results of an earlier run in the same folder are reused if nothing they depend on has changed.
    Paths in the document are relative to the document's own folder.

    \b
    vto run configs/demo.yaml
    vto run configs/demo.yaml -o runs/fine --set drape.target_error_mm=0.2
    vto run configs/demo.yaml --from drape --log run.jsonl
    vto run configs/demo.yaml --time-budget 5min --target-error 1mm
    """
    from vto_pipeline.cli.results import perform
    from vto_pipeline.io.documents import load_yaml
    from vto_pipeline.stages.entry.documents import Order

    order = Order(load_yaml(document), Path("runs") / document.stem)
    perform(session, order, base=document.resolve().parent, **options)
