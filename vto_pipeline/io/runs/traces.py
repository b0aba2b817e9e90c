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
_TRUE = ("true_mm_median", "true_mm_p95", "true_mm_max")
_LIMIT_BYTES = 100_000_000


def write_trace(path: Path, trace: Sequence[TraceRow]) -> None:
    """Write a row per record, floats in their shortest exact form; what is not known is left empty."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow((*_COLUMNS, *_TRUE))
    for row in trace:
        known = float(row.seconds), int(row.step), float(row.error_mm), float(row.residual)
        true = row.true_mm_median, row.true_mm_p95, row.true_mm_max
        table.writerow((*known, int(row.level), int(row.contacts), *("" if x is None else float(x) for x in true)))
    with replacing(path) as beside:
        beside.write_text(stream.getvalue(), encoding="utf-8")


def read_trace(path: Path) -> tuple[TraceRow, ...]:
    """Read trace.csv, also one without true distances.

    Raises:
        InputError: no such file; FormatError: other columns.
    """
    path = check_file(Path(path), {".csv"}, _LIMIT_BYTES)
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            header, *rows = csv.reader(stream)
        if tuple(header) not in (_COLUMNS, (*_COLUMNS, *_TRUE)):
            raise ValueError(f"columns {header}")
        return tuple(
            TraceRow(float(s), int(n), float(e), float(r), int(k), int(c), *(float(x) if x else None for x in true))
            for s, n, e, r, k, c, *true in rows
        )
    except (OverflowError, TypeError, ValueError, csv.Error) as e:
        raise FormatError(f"not a trace: {e}", where=str(path)) from None
