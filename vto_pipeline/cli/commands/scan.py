"""vto scan"""

from __future__ import annotations

import re
from pathlib import Path
from shutil import copyfile
from typing import Any

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session

_MARK = re.compile(r"(.+):(-?[\d.]+),(-?[\d.]+)")


@click.command("scan")
@click.argument("source", metavar="INPUT", type=PATH)
@click.option("--role", type=click.Choice(["garment", "body", "mannequin"]), required=True, help="What was captured.")
@click.option("--mannequin", type=PATH, metavar="FILE", help="Surface of the mannequin the garment was scanned on.")
@click.option(
    "--distance",
    "distances",
    type=(str, str, float),
    multiple=True,
    metavar="P Q METRES",
    help="A known distance in the photos; P and Q are PHOTO:X,Y+PHOTO:X,Y, one point marked in two photos or more.",
)
@pipeline_options
@pass_session
def scan_command(
    session: Session,
    source: Path,
    role: str,
    mannequin: Path | None,
    distances: tuple[tuple[str, str, float], ...],
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Reconstruct a garment, or the surface of a body or mannequin, from INPUT.

    INPUT is a folder of photos, a video, a folder of depth frames, a point cloud, or a mesh; its kind is detected.

    \b
    vto scan photos/ --role garment --mannequin form.ply -o runs/shirt
    vto scan photos/ --role mannequin --distance a.jpg:410,95+b.jpg:388,97 a.jpg:402,640+b.jpg:395,633 0.62
    vto scan customer.ply --role body
    """
    from vto_pipeline.cli.work import captured_kind, catalogue, run_document, typed_document
    from vto_pipeline.io.captures.photos import BOARD_FILE
    from vto_pipeline.io.files import replacing, resolved

    if mannequin is not None and role != "garment":
        raise click.UsageError("--mannequin is only valid with --role garment")
    kind = captured_kind(source, session)
    if distances and kind != "photos":
        raise click.UsageError("--distance is only valid with photos")
    unscaled = kind == "photos" and not distances and not (source / BOARD_FILE).is_file()
    wanted = [f"{role}_surface"]
    if role == "garment" and mannequin is not None:
        wanted = ["garment", "openings", "labels"]
    elif role == "garment" and unscaled:
        session.say("no mannequin, board or distance is given: the surface has no scale, and no garment is cut out")
    elif role == "garment":
        wanted = ["garment", "openings"]
    given = {"mannequin.surface": mannequin, f"{role}.{kind}": source}
    lengths = [{"one": _marks(one), "other": _marks(other), "metres": metres} for one, other, metres in distances]
    settings: dict[str, Any] = {"scale": {"lengths": lengths}} if lengths else {}
    document = typed_document("the command line", given, [*wanted, f"{role}_scan_report", "page"], settings)
    run = output or Path("runs") / f"scan_{resolved(source).stem}"
    run_document(document, Path.cwd(), run, overrides, force_all, session, catalogue())
    for name in () if role == "garment" else ("surface.ply", "scan_report.json"):
        scanned = run / "out" / f"{role}_{name}"
        if scanned.is_file():
            with replacing(run / "out" / name) as beside:  # what a scan makes has one name, whatever was scanned
                copyfile(scanned, beside)


def _marks(text: str) -> dict[str, list[float]]:
    """Return photo -> pixel from PHOTO:X,Y+PHOTO:X,Y."""
    found: dict[str, list[float]] = {}
    for mark in text.split("+"):
        match = _MARK.fullmatch(mark)
        if match is None:
            raise click.UsageError(f"--distance: {mark!r} is not PHOTO:X,Y, as in IMG_0001.jpg:412,233")
        found[match[1]] = [float(match[2]), float(match[3])]
    return found
