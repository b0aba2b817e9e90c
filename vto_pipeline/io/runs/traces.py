"""trace.csv: a drape's error against run time."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from vto_pipeline.errors import FormatError
from vto_pipeline.io.files import check_file, replacing
from vto_pipeline.model.cloth import TraceRow

_COLUMNS = ("seconds", "step", "error_mm", "residual", "level", "contacts")
_LIMIT_BYTES = 100_000_000


def write_trace(path: Path, trace: Sequence[TraceRow]) -> None:
    """Write a row per record, floats in their shortest exact form."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows(
        (float(row.seconds), int(row.step), float(row.error_mm), float(row.residual), int(row.level), int(row.contacts))
        for row in trace
    )
    with replacing(path) as beside:
        beside.write_text(stream.getvalue(), encoding="utf-8")


def read_trace(path: Path) -> tuple[TraceRow, ...]:
    """Read trace.csv.

    Raises:
        InputError: no such file; FormatError: other columns.
    """
    with check_file(Path(path), {".csv"}, _LIMIT_BYTES).open(encoding="utf-8", newline="") as stream:
        header, *rows = csv.reader(stream)
    try:
        if tuple(header) != _COLUMNS:
            raise ValueError(f"columns {header}")
        return tuple(TraceRow(float(s), int(n), float(e), float(r), int(k), int(c)) for s, n, e, r, k, c in rows)
    except ValueError as e:
        raise FormatError(f"not a trace: {e}", where=str(path)) from None
