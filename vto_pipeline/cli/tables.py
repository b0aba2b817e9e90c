"""Plain-text tables, at the width of the terminal or of 100 columns."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from vto_pipeline.pipeline.plan import Plan
from vto_pipeline.pipeline.request import Request


def table_lines(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table as lines of plain text."""
    table = Table(*headings, box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for row in rows:
        table.add_row(*row)
    width = shutil.get_terminal_size((100, 24)).columns
    page = io.StringIO()
    Console(file=page, width=max(width, 60), markup=False, highlight=False).print(table)
    return [line.rstrip() for line in page.getvalue().splitlines()]


def plan_lines(request: Request, plan: Plan) -> list[str]:
    """Return the lines of a plan: what is given and wanted, what runs, what is left out and why."""
    given = ", ".join(one.key for one in request.given.values())
    steps = [
        (str(number), step.stage.name, ", ".join(step.inputs), ", ".join(step.stage.makes))
        for number, step in enumerate(plan.steps, start=1)
    ]
    return [
        f"given: {given}",
        f"want:  {', '.join(request.want)}",
        "",
        *table_lines(("", "stage", "takes", "makes"), steps),
        "",
        *table_lines(("left out", "because"), plan.left_out.items()),
    ]
