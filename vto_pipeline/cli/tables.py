"""Plain-text tables, at the width of the terminal or of 100 columns."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterable, Mapping, Sequence

from rich import box
from rich.console import Console
from rich.table import Column, Table

from vto_pipeline.pipeline.execution.forecast import Expected
from vto_pipeline.pipeline.plan import Plan
from vto_pipeline.pipeline.request import Request


def table_lines(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table as lines of plain text."""
    columns = [Column(heading, overflow="fold") for heading in headings]  # a path that is cut names no file
    table = Table(*columns, box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for row in rows:
        table.add_row(*row)
    width = shutil.get_terminal_size((100, 24)).columns
    page = io.StringIO()
    Console(file=page, width=max(width, 60), markup=False, highlight=False).print(table)
    return [line.rstrip() for line in page.getvalue().splitlines()]


def plan_lines(request: Request, plan: Plan, expected: Mapping[str, Expected], verbose: bool) -> list[str]:
    """Return the lines of a plan: what is given and wanted, what runs at what cost, what is left out and why.

    Args:
        request: What is asked.
        plan: What will be done.
        expected: What is known of each stage.
        verbose: Also show each stage that is left out because what it works on is not given.
    """
    given = ", ".join(one.key for one in request.given.values())
    steps = []
    for number, step in enumerate(plan.steps, start=1):
        known = expected[step.stage.name]
        cost = "stored" if known.stored else "-" if known.seconds is None else f"{known.seconds:.1f}"
        memory = "-" if known.peak_mb is None else f"{known.peak_mb:.0f}"
        steps.append((str(number), step.stage.name, cost, memory, ", ".join(step.inputs), ", ".join(step.stage.makes)))
    missing = {
        name for name, reason in plan.left_out.items() if reason.endswith(" given") and not reason.endswith(" is given")
    }
    shown = {name: reason for name, reason in plan.left_out.items() if verbose or name not in missing}
    lines = [
        f"given: {given}",
        f"want:  {', '.join(request.want)}",
        "",
        *table_lines(("", "stage", "s", "MB", "takes", "makes"), steps),
        "",
        _total(expected),
        "",
        *table_lines(("left out", "because"), shown.items()),
    ]
    if missing and not verbose:
        lines.append(f"and {len(missing)} stages that work on what is not given; -v lists them")
    return lines


def _total(expected: Mapping[str, Expected]) -> str:
    """Return how long the rest takes, as far as that is known, in words."""
    rest = [one for one in expected.values() if not one.stored]
    if not rest:
        return "nothing to run: all results are stored"
    known = [one.seconds for one in rest if one.seconds is not None]
    unknown = len(rest) - len(known)
    if not known:
        return f"{len(rest)} stages to run; none has run in this folder before, so their time is not known"
    return f"{len(rest)} stages to run: about {sum(known):.0f} s" + (
        f", and {unknown} whose time is not known" if unknown else ""
    )
