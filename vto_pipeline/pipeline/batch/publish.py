"""What a batch has made, copied to a store: each file whole or not at all, and once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.errors import BatchError, InputError, VtoError
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.io.stores import check_address, copy_there, size_there
from vto_pipeline.pipeline.batch.ledger import LEDGER
from vto_pipeline.pipeline.execution.digest import digest_file
from vto_pipeline.pipeline.execution.folder import RECORD

PUBLISHED = "published.json"
_SUMMARY = ("page.html", "batch.parquet", "batch.csv", LEDGER)


class Publisher:
    """Copies files of a batch's folder to the same names at an address.

    Args:
        folder: BATCH; published.json there tells what has been copied.
        address: Of a folder in a store.

    Raises:
        ConfigError: it is no address.
    """

    def __init__(self, folder: Path, address: str) -> None:
        check_address(address, "--publish")
        self._folder, self._address = folder, address.rstrip("/")
        self._done: dict[str, str] = {}
        self._copied = 0
        try:
            record = read_json(folder / PUBLISHED)
            if record["address"] == self._address:
                self._done = dict(record["digests"])
        except (InputError, KeyError, TypeError, ValueError):  # none yet, or not ours
            pass

    def put_row(self, row: Mapping[str, Any]) -> int:
        """Copy what a row is done with, its record last; return how many files were.

        Args:
            row: Of the ledger; one that is not done has nothing.

        Raises:
            InputError, MissingDependencyError: as `put`.
        """
        if row["status"] != "done":
            return 0
        record, *others = row.get("files", [f"rows/{row['name']}/{RECORD}"])
        return self.put([*others, *filter(None, [row["picture"]]), record])

    def put_batch(self, batch: Mapping[str, Any]) -> str:
        """Copy what is not there yet of all rows, and then the summary; return in words how many files were copied.

        Args:
            batch: What batch.json holds.

        Raises:
            BatchError: the store fails.
        """
        try:
            for row in batch["rows"]:
                self.put_row(row)
            self.put(name for name in _SUMMARY if (self._folder / name).is_file())
        except VtoError as error:
            hint = "run the same command again; what is there is not copied again"
            raise BatchError(f"not all is published: {error.problem}", where=error.where, hint=hint) from None
        return f"{self._copied} files were copied to {self._address}"

    def put(self, names: Iterable[str]) -> int:
        """Copy files that are not there as they are here; return how many were.

        Args:
            names: Paths in BATCH, in the order in which they are to appear.

        Raises:
            InputError, MissingDependencyError: as `io.stores`; those before it are there.
        """
        count = 0
        try:
            for name in names:
                path, address = self._folder / name, f"{self._address}/{name}"
                digest = digest_file(path)
                if self._done.get(name) != digest or size_there(address) != path.stat().st_size:
                    copy_there(path, address)
                    self._done[name] = digest
                    count += 1
                    self._copied += 1
        finally:
            write_json(self._folder / PUBLISHED, {"address": self._address, "digests": self._done})
        return count
