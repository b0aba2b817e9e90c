"""What became of the rows of a batch, in the same columns in every format, and failures of one kind together."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.io.files import replacing

COLUMNS = {
    "name": "string",
    "status": "string",
    "exit_code": "int64",
    "failure": "string",
    "seconds": "float64",
    "peak_mb": "float64",
    "tries": "int64",
    "result": "string",
    "warnings": "string",
    "problem": "string",
    "page": "string",
    "picture": "string",
}
"""Of batch.csv and batch.parquet, with the names of their types; batch.json has more."""

_FIRST_WORDS = 8
_OF_THE_ROW = re.compile(r"\([^()]*\)|'[^']*'|\"[^\"]*\"")
"""Places and names in a message, which differ from row to row."""


def failure_kind(row: Mapping[str, Any]) -> str:
    """Return exit code and first words of the reason, the same for rows that failed alike; empty for one that did not.

    Args:
        row: Its status, exit code and problem.
    """
    if row["status"] in ("done", "waiting"):
        return ""
    reason = re.sub(r"\d+(\.\d+)?", "#", _OF_THE_ROW.sub(" ", row["problem"])) or row["status"]
    words = " ".join(reason.split()[:_FIRST_WORDS])
    return f"exit {row.get('exit_code', '?')}: {re.sub(r' (?=[:;,.])', '', words).strip(':;,. ')}"


def failures(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the kinds of failure, the most frequent first: kind, count, names of the rows."""
    names: dict[str, list[str]] = {}
    for row in rows:
        if kind := failure_kind(row):
            names.setdefault(kind, []).append(row["name"])
    found = [{"kind": kind, "count": len(those), "rows": those} for kind, those in names.items()]
    return sorted(found, key=lambda one: (-len(one["rows"]), one["kind"]))


def failure_lines(groups: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return each kind of failure as a line, with the first of its rows."""
    return [
        f"{one['count']} x {one['kind']} ({', '.join(one['rows'][:3])}{', ...' if one['count'] > 3 else ''})"
        for one in groups
    ]


def row_lines(row: Mapping[str, Any]) -> list[str]:
    """Return what a row says: why it is not done, or else what it found, and what it warns of."""
    warned = f"warning: {row['warnings']}" if row["warnings"] else ""
    return [line for line in (row["problem"] or row["result"], warned) if line]


def write_csv(rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write batch.csv, whole or not at all."""
    with replacing(path) as beside, beside.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(COLUMNS), restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)


def write_parquet(rows: Iterable[Mapping[str, Any]], path: Path) -> bool:
    """Write batch.parquet, whole or not at all; return whether there is a library for it."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        return False
    columns: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    for row in rows:
        for name, column in columns.items():
            column.append(row.get(name))
    schema = pa.schema([(name, getattr(pa, kind)()) for name, kind in COLUMNS.items()])
    with replacing(path) as beside:
        parquet.write_table(pa.table(columns, schema=schema), beside)
    return True
