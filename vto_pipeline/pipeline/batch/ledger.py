"""batch.json and batch.csv: what has become of every row.

Each row that ends is a line more in a journal at once. From time to time the journal is taken into batch.json, so
rarely that a row costs the same in a batch of any size.
"""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import write_json
from vto_pipeline.pipeline.batch.row import RowResult
from vto_pipeline.pipeline.batch.summary import failure_kind, failures, write_csv
from vto_pipeline.pipeline.execution.folder import RECORD

LEDGER = "batch.json"
JOURNAL = "batch.partial.jsonl"

_UNKNOWN = "not known: done by an earlier version, which noted none"
_BLANK = {"result": "", "warnings": "", "problem": "", "failure": "", "page": "", "picture": ""}
_REST = 50.0  # times as long as writing both files took, they are left alone


class Ledger:
    """What has become of every row of a batch.

    Args:
        folder: BATCH.
        names: Its rows, in their order.
    """

    def __init__(self, folder: Path, names: Iterable[str]) -> None:
        self._folder = folder
        self._due = 0.0
        known = {row["name"]: row for row in read_ledger(folder)["rows"]} if (folder / LEDGER).is_file() else {}
        new = {"status": "waiting", "key": "", **_BLANK}
        self.rows: dict[str, dict[str, Any]] = {name: known.get(name, {"name": name, **new}) for name in names}

    def is_done(self, name: str, key: str) -> bool:
        """Whether a row has been done before, with the same result to be expected."""
        row = self.rows[name]
        return bool(row["status"] == "done" and row["key"] == key)

    def expected_seconds(self, name: str, key: str, forecast: float | None) -> float:
        """Return how long a row will take [s]; infinite where nothing tells.

        Args:
            name: Of the row.
            key: Of its result. What failed early will fail as early again.
            forecast: By rows that are like it [s]; None where there are none.
        """
        row = self.rows[name]
        before = float(row["seconds"]) if row.get("exit_code", -1) >= 0 else math.inf  # not where it was killed
        if forecast is None:
            return before
        return min(forecast, before) if row["key"] == key else forecast

    def wait(self, name: str) -> None:
        """Note that a row is still to be run."""
        self.rows[name] |= {**_BLANK, "status": "waiting"}

    def enter(self, result: RowResult, words: str, shown: Mapping[str, Any] | None = None) -> None:
        """Note what became of a row.

        Args:
            result: How it ended.
            words: What it found.
            shown: Its `warnings` in words, its `page` and `picture`, and the `files` that it is done with, all as paths
                in BATCH.
        """
        self.rows[result.name] = row = {**_BLANK, **(shown or {}), **asdict(result), "result": words}
        row["failure"] = failure_kind(row)
        with (self._folder / JOURNAL).open("a", encoding="utf-8") as journal:
            journal.write(json.dumps(row, ensure_ascii=False) + "\n")
        if time.monotonic() >= self._due:
            self.save()

    def counts(self) -> dict[str, int]:
        """Return how many rows there are of each status."""
        return _counts(self.rows.values())

    def save(self) -> None:
        """Write both files whole, and begin the journal anew."""
        began = time.monotonic()
        rows = list(self.rows.values())
        record = {"schema": 1, "counts": self.counts(), "failures": failures(rows), "rows": rows}
        write_json(self._folder / LEDGER, record)
        write_csv(rows, self._folder / "batch.csv")
        (self._folder / JOURNAL).unlink(missing_ok=True)
        ended = time.monotonic()
        self._due = ended + _REST * (ended - began)


def read_ledger(folder: Path) -> Mapping[str, Any]:
    """Read batch.json of a batch's folder, and what its journal has on top.

    A row that was done and whose files are no longer there waits again. `failures` has those of one kind together.

    Raises:
        InputError: it holds none, or a damaged one.
    """
    path = folder / LEDGER
    later = {row["name"]: row for row in _journal(folder / JOURNAL)}  # first: it is emptied after the other is written
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not all({"name", "status", "key"} <= set(row) for row in found["rows"]):
            raise KeyError("name, status, key")
    except FileNotFoundError:
        raise InputError("not the folder of a batch: it has no batch.json", where=str(folder)) from None
    except (ValueError, KeyError, TypeError) as e:
        raise InputError(f"not the record of a batch: {e}", where=str(path), hint="remove it, and run again") from None
    rows = [_BLANK | _with_its_files(later.get(row["name"], row), folder) for row in found["rows"]]
    return {**found, "counts": _counts(rows), "failures": failures(rows), "rows": rows}


def _with_its_files(row: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a row as it is, or as waiting where files that it was done with are gone."""
    if row["status"] != "done":
        return row
    files = row.get("files", [f"rows/{row['name']}/{RECORD}"])
    lacking = next((f"{name} is gone" for name in files if not (folder / name).exists()), None)
    if lacking is None:
        return {"warnings": _UNKNOWN, **row}
    return {**row, **_BLANK, "status": "waiting", "problem": lacking}


def _journal(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a journal; a line that was cut short by a kill is none."""
    if path.is_file():
        with suppress(FileNotFoundError):  # emptied meanwhile
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                with suppress(ValueError):
                    yield json.loads(line)


def _counts(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    return dict(Counter(row["status"] for row in rows))
