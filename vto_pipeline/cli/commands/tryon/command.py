"""vto tryon"""

from __future__ import annotations

from pathlib import Path

import click

from vto_pipeline.cli.options import PATH, message_options
from vto_pipeline.cli.session import Session, pass_session

PAGE = "try_on.html"


@click.command("tryon")
@click.argument("document", metavar="FILE.yaml", type=PATH)
@click.option("--batch", type=PATH, metavar="BATCH", help="Folder of the batch. [default: runs/NAME]")
@click.option("-o", "--output", type=PATH, metavar="PAGE.html", help=f"The page. [default: BATCH/{PAGE}]")
@message_options
@pass_session
def tryon_command(session: Session, document: Path, batch: Path | None, output: Path | None) -> None:
    """Make a page with sliders from a batch of drapes: sizes and bodies in between are interpolated at once.

    The rows of the batch are all combinations of what they differ in. A slider is made for each number, buttons for
    whatever else it is. How far the page is from real drapes is measured, by leaving drapes out, and told on it.

    \b
    vto batch sizes.yaml -o batches/sizes
    vto tryon sizes.yaml --batch batches/sizes
    """
    from vto_pipeline.errors import InputError
    from vto_pipeline.io.files import replacing
    from vto_pipeline.pipeline.batch.grid import grid_of
    from vto_pipeline.pipeline.batch.ledger import read_ledger
    from vto_pipeline.pipeline.batch.order import read_order
    from vto_pipeline.stages.entry.try_ons import try_on_page

    grid = grid_of(read_order(document), str(document))
    folder = (batch or Path("runs") / document.stem).absolute()
    states = {row["name"]: row["status"] for row in read_ledger(folder)["rows"]}
    missing = [row.name for row in grid.rows if states.get(row.name) != "done"]
    if missing:
        named = f"{', '.join(missing[:5])}{' and more' if len(missing) > 5 else ''}"
        hint = f"vto batch {document} -o {folder}"
        raise InputError(f"{len(missing)} of {len(grid.rows)} rows are not done: {named}", where=str(folder), hint=hint)
    page = try_on_page(grid, document.stem.replace("_", " "), lambda name: folder / "rows" / name, session.say)
    path = output or folder / PAGE
    with replacing(path) as beside:
        beside.write_text(page.html, encoding="utf-8")
    missed = None if page.left_out is None else {f"{key}_mm": 1e3 * value for key, value in page.left_out.items()}
    words = "no drape lies between two others: the error between drapes is not known"
    if missed is not None:
        words = "a drape left out is missed by {median_mm:.1f} mm (median), {p95_mm:.1f} mm (95 %)".format(**missed)
    told = {"page": str(path), "left_out": missed, "inside_mm": 1e3 * page.inside}
    session.answer(told, [str(path), words, f"midway, cloth gets {told['inside_mm']:.1f} mm into the body at most"])
