"""vto scan"""

from __future__ import annotations

from pathlib import Path
from shutil import copyfile

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session


@click.command("scan")
@click.argument("source", metavar="INPUT", type=PATH)
@click.option("--role", type=click.Choice(["garment", "body", "mannequin"]), required=True, help="What was captured.")
@click.option("--mannequin", type=PATH, metavar="FILE", help="Surface of the mannequin the garment was scanned on.")
@pipeline_options
@pass_session
def scan_command(
    session: Session,
    source: Path,
    role: str,
    mannequin: Path | None,
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Reconstruct a garment, or the surface of a body or mannequin, from INPUT.

    INPUT is a folder of photos, a video, a folder of depth frames, a point cloud, or a mesh; its kind is detected.

    \b
    vto scan photos/ --role garment --mannequin form.ply -o runs/shirt
    vto scan customer.ply --role body
    """
    from vto_pipeline.cli.work import captured_kind, catalogue, run_document, typed_document
    from vto_pipeline.io.files import replacing, resolved

    if mannequin is not None and role != "garment":
        raise click.UsageError("--mannequin is only valid with --role garment")
    kind = captured_kind(source, session)
    want = [f"{role}_surface", "page"]
    if role == "garment":
        want = ["garment", "openings", *(["labels"] if mannequin else []), "page"]
    given = {f"{role}.{kind}": source, "mannequin.surface": mannequin}
    document = typed_document("the command line", given, want, {})
    run = output or Path("runs") / f"scan_{resolved(source).stem}"
    run_document(document, Path.cwd(), run, overrides, force_all, session, catalogue())
    scanned = run / "out" / f"{role}_surface.ply"
    if role != "garment" and scanned.is_file():
        with replacing(run / "out" / "surface.ply") as beside:  # what a scan makes has one name, whatever was scanned
            copyfile(scanned, beside)
