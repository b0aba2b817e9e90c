"""batch.json and batch.csv: what has become of every row.

Each row that ends is a line more in a journal at once. From time to time the journal is taken into batch.json, so
rarely that a row costs the same in a batch of any size.
"""

from __future__ import annotations

import csv
import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.files import replacing
from vto_pipeline.pipeline.batch.row import RowResult

LEDGER = "batch.json"
JOURNAL = "batch.partial.jsonl"

_COLUMNS = ("name", "status", "exit_code", "seconds", "peak_mb", "tries", "result", "problem")
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
        waiting = {"status": "waiting", "key": "", "problem": "", "result": ""}
        self.rows: dict[str, dict[str, Any]] = {name: known.get(name, {"name": name, **waiting}) for name in names}

    def is_done(self, name: str, key: str) -> bool:
        """Whether a row has been done before, with the same result to be expected."""
        row = self.rows[name]
        return bool(row["status"] == "done" and row["key"] == key)

    def expected_seconds(self, name: str) -> float:
        """Return how long a row took before [s]; infinite where it was never run."""
        return float(self.rows[name].get("seconds", float("inf")))

    def wait(self, name: str) -> None:
        """Note that a row is still to be run."""
        self.rows[name]["status"] = "waiting"

    def enter(self, result: RowResult, words: str) -> None:
        """Note what became of a row, and what it found in words."""
        self.rows[result.name] = row = {**asdict(result), "result": words}
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
        write_json(self._folder / LEDGER, {"schema": 1, "counts": self.counts(), "rows": list(self.rows.values())})
        with replacing(self._folder / "batch.csv") as beside, beside.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, _COLUMNS, restval="", extrasaction="ignore")
            writer.writeheader()
            writer.writerows(self.rows.values())
        (self._folder / JOURNAL).unlink(missing_ok=True)
        ended = time.monotonic()
        self._due = ended + _REST * (ended - began)


def read_ledger(folder: Path) -> Mapping[str, Any]:
    """Read batch.json of a batch's folder, and what its journal has on top.

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
    rows = [later.get(row["name"], row) for row in found["rows"]]
    return {**found, "counts": _counts(rows), "rows": rows}


def _journal(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the rows of a journal; a line that was cut short by a kill is none."""
    if path.is_file():
        with suppress(FileNotFoundError):  # emptied meanwhile
            for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
                with suppress(ValueError):
                    yield json.loads(line)


def _counts(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    return dict(Counter(row["status"] for row in rows))
