"""Rows of a bench that outlive whatever ends it: each printed and appended to a file as soon as it is there."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from vto_pipeline.bench.bench import Value


class LiveRows:
    """A table on stdout, separated by tabs, and FOLDER/rows.jsonl.

    Args:
        folder: Made if need be.
        columns: Keys of a row that are printed; the file has all.
    """

    def __init__(self, folder: Path, columns: Sequence[str]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file, self._columns = folder / "rows.jsonl", columns
        self._table = csv.writer(sys.stdout, "excel-tab")
        self._table.writerow(columns)

    def add(self, row: Mapping[str, Value]) -> None:
        """Write one row; what it lacks is shown as a dash."""
        with self._file.open("a") as rows:
            rows.write(json.dumps(dict(row)) + "\n")
        self._table.writerow([_text(row.get(name)) for name in self._columns])
        sys.stdout.flush()


def _text(value: Value) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
