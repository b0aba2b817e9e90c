"""batch.json and batch.csv: what has become of every row. Rewritten after each, whole or not at all."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import write_json
from vto_pipeline.io.files import replacing
from vto_pipeline.pipeline.batch.row import RowResult

LEDGER = "batch.json"

_COLUMNS = ("name", "status", "exit_code", "seconds", "peak_mb", "tries", "result", "problem")


class Ledger:
    """What has become of every row of a batch.

    Args:
        folder: BATCH.
        names: Its rows, in their order.
    """

    def __init__(self, folder: Path, names: Iterable[str]) -> None:
        self._folder = folder
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
        self.rows[result.name] = {**asdict(result), "result": words}
        self.save()

    def counts(self) -> dict[str, int]:
        """Return how many rows there are of each status."""
        return dict(Counter(row["status"] for row in self.rows.values()))

    def save(self) -> None:
        """Write both files."""
        write_json(self._folder / LEDGER, {"schema": 1, "counts": self.counts(), "rows": list(self.rows.values())})
        with replacing(self._folder / "batch.csv") as beside, beside.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, _COLUMNS, restval="", extrasaction="ignore")
            writer.writeheader()
            writer.writerows(self.rows.values())


def read_ledger(folder: Path) -> Mapping[str, Any]:
    """Read batch.json of a batch's folder.

    Raises:
        InputError: it holds none, or a damaged one.
    """
    path = folder / LEDGER
    try:
        found: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if not all({"name", "status", "key"} <= set(row) for row in found["rows"]):
            raise KeyError("name, status, key")
    except FileNotFoundError:
        raise InputError("not the folder of a batch: it has no batch.json", where=str(folder)) from None
    except (ValueError, KeyError, TypeError) as e:
        raise InputError(f"not the record of a batch: {e}", where=str(path), hint="remove it, and run again") from None
    return found
