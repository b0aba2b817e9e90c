"""vto drape"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, running
from vto_pipeline.cli.session import Session, pass_session

_WANT = ("draped", "audit", "trace", "render_mesh", "fit_report", "page")


@click.command("drape")
@click.option("--garment", type=PATH, required=True, metavar="FILE", help="Garment mesh.")
@click.option("--body", type=PATH, metavar="FILE", help="Avatar, another model's body, or a mesh as it stands.")
@click.option("--measurements", type=PATH, metavar="FILE", help="Make the body from these, in place of --body.")
@click.option(
    "--source-body",
    type=PATH,
    metavar="FILE",
    help="What the garment was on: avatar or mesh. Absent: the garment is put where it belongs on the body.",
)
@click.option(
    "--fabric", default="cotton_poplin", show_default=True, metavar="NAME|FILE", help="Preset or fabric file."
)
@click.option("--regraded", is_flag=True, help="Show how it would look in the customer's size, not whether it fits.")
@running
@pass_session
def drape_command(
    session: Session,
    garment: Path,
    body: Path | None,
    measurements: Path | None,
    source_body: Path | None,
    fabric: str,
    regraded: bool,
    output: Path | None,
    overrides: tuple[str, ...],
    force_all: bool,
) -> None:
    """Drape a garment on a body.

    \b
    vto drape --garment shirt.ply --source-body form.ply --measurements customer.yaml --fabric denim
    vto drape --garment shirt.ply --source-body form.ply --body customer.ply --regraded -o runs/shirt
    """
    from vto_pipeline.cli.work import carry_out, catalogue, typed_document

    if (body is None) == (measurements is None):
        raise click.UsageError("give the body: either --body or --measurements")
    given = {
        "garment.mesh": garment,
        f"mannequin.{'avatar' if _is_avatar(source_body) else 'surface'}": source_body,
        f"body.{'avatar' if _is_avatar(body) else 'mesh'}": body,
        "body.measurements": measurements,
        "fabric": fabric,
    }
    document = typed_document("the command line", given, _WANT, {"grade": {"mode": "regraded"}} if regraded else {})
    name = Path("runs") / f"drape_{garment.resolve().stem}"
    carry_out(document, Path.cwd(), output or name, overrides, force_all, session, catalogue())


def _is_avatar(path: Path | None) -> bool:
    """Return whether it is one of ours; an archive of another model's body is a mesh."""
    from vto_pipeline.io.sniff import find_kind

    if path is None or path.suffix.lower() != ".npz":
        return False
    return not path.is_file() or find_kind(path)[0] == "avatar"  # what is missing is told later
