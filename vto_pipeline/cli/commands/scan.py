"""vto scan"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session

_MARK = re.compile(r"(.+):(-?[\d.]+),(-?[\d.]+)")


@click.command("scan")
@click.argument("source", metavar="INPUT", type=PATH)
@click.option("--role", type=click.Choice(["garment", "body", "mannequin"]), required=True, help="What was captured.")
@click.option("--mannequin", type=PATH, metavar="FILE", help="Mannequin it was on: surface, or tape.yaml.")
@click.option(
    "--distance",
    "distances",
    type=(str, str, float),
    multiple=True,
    metavar="P Q METRES",
    help="A known distance in the photos; P and Q are PHOTO:X,Y+PHOTO:X,Y, one point marked in two photos or more.",
)
@click.option(
    "--stature",
    type=float,
    metavar="METRES",
    help="Height of the person or form in photos, where no board, distance or mannequin tells the scale.",
)
@pipeline_options
@pass_session
def scan_command(
    session: Session,
    source: Path,
    role: str,
    mannequin: Path | None,
    distances: tuple[tuple[str, str, float], ...],
    stature: float | None,
    **options: Any,
) -> None:
    """Reconstruct a garment, or the surface of a body or mannequin, from INPUT.

    INPUT is a folder of photos, a video, a folder of depth frames, a point cloud, or a mesh; its kind is detected.

    \b
    vto scan photos/ --role garment --mannequin form.ply -o runs/shirt
    vto scan photos/ --role mannequin --distance a.jpg:410,95+b.jpg:388,97 a.jpg:402,640+b.jpg:395,633 0.62
    vto scan customer_photos/ --role body --stature 1.72
    vto scan customer.ply --role body
    """
    from vto_pipeline.cli.results import perform
    from vto_pipeline.stages.entry.documents import scan_order

    lengths = [{"one": _marks(one), "other": _marks(other), "metres": metres} for one, other, metres in distances]
    perform(session, scan_order(source, role, mannequin, lengths, stature, "the command line"), **options)


def _marks(text: str) -> dict[str, list[float]]:
    """Return photo -> pixel from PHOTO:X,Y+PHOTO:X,Y."""
    found: dict[str, list[float]] = {}
    for mark in text.split("+"):
        match = _MARK.fullmatch(mark)
        if match is None:
            raise click.UsageError(f"--distance: {mark!r} is not PHOTO:X,Y, as in IMG_0001.jpg:412,233")
        found[match[1]] = [float(match[2]), float(match[3])]
    return found
