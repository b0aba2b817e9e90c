"""vto fit"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, lifelike_option, pipeline_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("fit")
@click.option("--scan", "scan", type=PATH, metavar="INPUT", help="Body scan: photos, depth frames, cloud or mesh.")
@click.option("--measurements", type=PATH, metavar="FILE", help="YAML with girths and lengths.")
@click.option("--front", type=PATH, metavar="PNG", help="Photo or silhouette from the front.")
@click.option("--side", type=PATH, metavar="PNG", help="Photo or silhouette from the side.")
@click.option("--stature", type=float, metavar="METRES", help="Body height: with --front and --side, or for photos.")
@click.option("--sex", type=click.Choice(["female", "male", "neutral"]), help="Sex, where the input does not say.")
@lifelike_option
@pipeline_options
@pass_session
def fit_command(
    session: Session,
    scan: Path | None,
    measurements: Path | None,
    front: Path | None,
    side: Path | None,
    stature: float | None,
    sex: str | None,
    lifelike: str | None,
    **options: Any,
) -> None:
    """Fit an avatar to a body scan, to measurements, or to a front and a side photo.

    \b
    vto fit --measurements customer.yaml -o runs/customer
    vto fit --scan customer.ply --sex female
    vto fit --front front.png --side side.png --stature 1.72
    """
    from vto_pipeline.cli.results import perform
    from vto_pipeline.stages.entry.documents import fit_order

    perform(session, fit_order(scan, measurements, front, side, stature, sex, "the command line", lifelike), **options)
