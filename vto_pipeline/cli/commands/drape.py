"""vto drape"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from vto_pipeline.cli.options import PATH, drape_options, lifelike_option
from vto_pipeline.cli.session import Session, pass_session


@click.command("drape")
@click.option(
    "--garment",
    "garments",
    type=PATH,
    required=True,
    multiple=True,
    metavar="FILE",
    help="Garment mesh or sewing pattern; repeat for layers, innermost first.",
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
@click.option(
    "--motion",
    metavar="FILE|NAME",
    help="Carry the draped garment through a motion: BVH, glTF, SMPL poses, YAML, or a preset such as walking_step.",
)
@click.option(
    "--pose",
    "poses",
    multiple=True,
    metavar="NAME",
    help="Look at the draped garment in this pose, too: arms_down, arms_up, step, sitting, t_pose, a_pose; repeat "
    "for several.",
)
@click.option("--regraded", is_flag=True, help="Show how it looks in the customer's size, not whether it fits.")
@lifelike_option
@drape_options
@pass_session
def drape_command(
    session: Session,
    garments: tuple[Path, ...],
    body: Path | None,
    measurements: Path | None,
    source_body: Path | None,
    fabrics: tuple[str, ...],
    motion: str | None,
    poses: tuple[str, ...],
    regraded: bool,
    lifelike: str | None,
    **options: Any,
) -> None:
    """Drape one garment, or several in layers, on a body.

    \b
    vto drape --garment shirt.ply --source-body form.ply --measurements customer.yaml --fabric denim
    vto drape --garment shirt.ply --source-body form.ply --body customer.ply --regraded -o runs/shirt
    vto drape --garment trousers.ply --fabric denim --garment shirt.ply --fabric cotton_poplin --body customer.ply
    vto drape --garment shirt.ply --body runs/customer/out/avatar.npz --motion walk.bvh -o runs/walk
    vto drape --garment shirt.ply --measurements customer.yaml --pose arms_up --pose sitting
    """
    from vto_pipeline.cli.results import perform
    from vto_pipeline.stages.entry.documents import drape_order

    order = drape_order(
        garments, fabrics, body, measurements, source_body, regraded, "the command line", motion, poses, lifelike
    )
    perform(session, order, **options)
