"""vto fit"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("fit")
@click.option("--scan", "scan", type=PATH, metavar="INPUT", help="Body scan: photos, depth frames, cloud or mesh.")
@click.option("--measurements", type=PATH, metavar="FILE", help="YAML with girths and lengths.")
@click.option("--front", type=PATH, metavar="PNG", help="Photo or silhouette from the front.")
@click.option("--side", type=PATH, metavar="PNG", help="Photo or silhouette from the side.")
@click.option("--stature", type=float, metavar="METRES", help="Body height; required with --front and --side.")
@click.option("--sex", type=click.Choice(["female", "male", "neutral"]), help="Sex, where the input does not say.")
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
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Fit an avatar to a body scan, to measurements, or to a front and a side photo.

    \b
    vto fit --measurements customer.yaml -o runs/customer
    vto fit --scan customer.ply --sex female
    vto fit --front front.png --side side.png --stature 1.72
    """
    from vto_pipeline.cli.work import captured_kind, catalogue, run_document, typed_document
    from vto_pipeline.io.files import resolved

    photos = (front, side, stature)
    if any(part is not None for part in photos) and None in photos:
        raise click.UsageError("--front, --side and --stature must be given together")
    ways = [way for way in (scan, measurements, front) if way is not None]
    if len(ways) != 1:
        raise click.UsageError("give one of --scan, --measurements, or --front with --side and --stature")
    given: dict[str, Any] = {"body.measurements": measurements}
    if scan is not None:
        given[f"body.{captured_kind(scan, session)}"] = scan
    if front is not None:
        given["body.silhouettes"] = {"front": str(front), "side": str(side), "stature": stature}
    tables = catalogue()
    settings = {name: {"sex": sex} for name, kind in tables.sections.items() if sex and "sex" in kind.model_fields}
    if sex and not settings:
        raise click.UsageError("--sex does not apply to this input; write `sex:` in the measurements file")
    document = typed_document("the command line", given, ["avatar", "measurements", "landmarks", "page"], settings)
    name = Path("runs") / f"fit_{resolved(ways[0]).stem}"
    run_document(document, Path.cwd(), output or name, overrides, force_all, session, tables)
