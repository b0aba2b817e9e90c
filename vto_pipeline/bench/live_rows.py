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

    Attributes:
        rows: All there are in the file, those of earlier runs first.
    """

    def __init__(self, folder: Path, columns: Sequence[str]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._file, self._columns = folder / "rows.jsonl", columns
        lines = self._file.read_text().splitlines() if self._file.exists() else []
        self.rows: list[Mapping[str, Value]] = [json.loads(line) for line in lines]
        self._table = csv.writer(sys.stdout, "excel-tab")
        self._table.writerow(columns)

    def add(self, row: Mapping[str, Value]) -> None:
        """Write one row; what it lacks is shown as a dash."""
        self.rows.append(row)
        with self._file.open("a") as rows:
            rows.write(json.dumps(dict(row)) + "\n")
        self._table.writerow([_text(row.get(name)) for name in self._columns])
        sys.stdout.flush()

    def write_csv(self) -> None:
        """Write FOLDER/rows.csv, with all rows and the printed columns."""
        with self._file.with_suffix(".csv").open("w", newline="") as file:
            table = csv.writer(file)
            table.writerow(self._columns)
            table.writerows([row.get(name) for name in self._columns] for row in self.rows)


def _text(value: Value) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
