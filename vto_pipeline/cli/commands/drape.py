"""vto drape"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, pipeline_options
from vto_pipeline.cli.session import Session, pass_session

_WANT = ("draped", "audit", "trace", "render_mesh", "fit_report", "page")


@click.command("drape")
@click.option(
    "--garment",
    "garments",
    type=PATH,
    required=True,
    multiple=True,
    metavar="FILE",
    help="Garment mesh; repeat for layers, innermost first.",
)
@click.option("--body", type=PATH, metavar="FILE", help="Avatar, skinned body of another model, or plain mesh.")
@click.option("--measurements", type=PATH, metavar="FILE", help="Build the body from these instead of --body.")
@click.option(
    "--source-body",
    type=PATH,
    metavar="FILE",
    help="Avatar or mesh the garment was scanned on; without it, the garment is placed automatically.",
)
@click.option(
    "--fabric",
    "fabrics",
    default=("cotton_poplin",),
    show_default=True,
    multiple=True,
    metavar="NAME|FILE",
    help="Preset or fabric file: one for all garments, or one per garment.",
)
@click.option("--regraded", is_flag=True, help="Show how it looks in the customer's size, not whether it fits.")
@pipeline_options
@pass_session
def drape_command(
    session: Session,
    garments: tuple[Path, ...],
    body: Path | None,
    measurements: Path | None,
    source_body: Path | None,
    fabrics: tuple[str, ...],
    regraded: bool,
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Drape one garment, or several in layers, on a body.

    \b
    vto drape --garment shirt.ply --source-body form.ply --measurements customer.yaml --fabric denim
    vto drape --garment shirt.ply --source-body form.ply --body customer.ply --regraded -o runs/shirt
    vto drape --garment trousers.ply --fabric denim --garment shirt.ply --fabric cotton_poplin --body customer.ply
    """
    from vto_pipeline.cli.work import catalogue, run_document, typed_document
    from vto_pipeline.io.files import resolved

    if (body is None) == (measurements is None):
        raise click.UsageError("give either --body or --measurements")
    given = {
        **_garments(garments, fabrics),
        f"mannequin.{'avatar' if _is_avatar(source_body) else 'surface'}": source_body,
        f"body.{'avatar' if _is_avatar(body) else 'mesh'}": body,
        "body.measurements": measurements,
    }
    document = typed_document("the command line", given, _WANT, {"grade": {"mode": "regraded"}} if regraded else {})
    name = Path("runs") / f"drape_{'_'.join(resolved(garment).stem for garment in garments)}"
    run_document(document, Path.cwd(), output or name, overrides, force_all, session, catalogue())


def _garments(garments: tuple[Path, ...], fabrics: tuple[str, ...]) -> dict[str, Any]:
    """Return the `given` section of the garments; several are named by their files.

    Raises:
        click.UsageError: two have the same, or the fabrics are neither one nor as many.
    """
    if len(fabrics) not in (1, len(garments)):
        raise click.UsageError(
            f"{len(fabrics)} fabrics for {len(garments)} garments: give one for all, or one per garment"
        )
    if len(garments) == 1:
        return {"garment.mesh": garments[0], "fabric": fabrics[0]}
    found: dict[str, Any] = {}
    for garment, fabric in zip(garments, fabrics * (len(garments) // len(fabrics)), strict=True):
        name = re.sub(r"[^a-z0-9]+", "_", garment.stem.lower()).strip("_")
        if name in found:
            raise click.UsageError(f"two garments are named {name}: rename a file, or name them in a document")
        found[name] = {"mesh": str(garment), "fabric": fabric}
    return {"garments": found}


def _is_avatar(path: Path | None) -> bool:
    """Return whether a file is our own avatar; a body of another model counts as a mesh."""
    from vto_pipeline.io.sniff import find_kind

    if path is None or path.suffix.lower() != ".npz":
        return False
    return not path.is_file() or find_kind(path)[0] == "avatar"  # what is missing is told later
