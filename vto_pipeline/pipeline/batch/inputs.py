"""What a batch is given in stores: copied here once, and kept by content."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, replace
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

from vto_pipeline.errors import InputError, VtoError
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.io.stores import RemoteFile, copy_here, is_address, list_files
from vto_pipeline.pipeline.batch.order import Row, strings_in, with_strings_changed
from vto_pipeline.pipeline.batch.roots import Roots
from vto_pipeline.pipeline.execution.digest import digest_path

INDEX = "index.json"
_PARTIAL = ".partial"


class Inputs:
    """The given files and folders of a batch that lie in stores.

    Each lies in a folder that is named by the digest of its content: the same file at two addresses is one input, and
    what has been computed from it is found again.

    Args:
        folder: BATCH/inputs; index.json there tells where each came from.
        roots: What may be read.
        say: Takes a line for each that is copied.
    """

    def __init__(self, folder: Path, roots: Roots, say: Callable[[str], None] = lambda text: None) -> None:
        self._folder, self._roots, self._say = folder, roots, say
        self._here: dict[str, Path] = {}
        try:
            self._index: dict[str, Any] = dict(read_json(folder / INDEX))
        except (InputError, TypeError, ValueError):  # none yet, or not ours
            self._index = {}

    def check(self, rows: Sequence[Row]) -> bool:
        """Refuse addresses that may not be read, before anything is asked of a store; return whether there are any.

        Raises:
            ConfigError: one may not.
        """
        found = False
        for row in rows:
            for text in strings_in(row.data.get("given", {})):
                if is_address(text):
                    self._roots.check_address(text, row.where)
                    found = True
        return found

    def of_rows(self, rows: Sequence[Row]) -> list[Row]:
        """Return the rows with the path here of each address that they are given; they have been checked.

        Raises:
            InputError: nothing is there, or its store does not give it; with the row.
        """
        return [self._with_paths(row) for row in rows]

    def _with_paths(self, row: Row) -> Row:
        def path_or_same(text: str) -> str:
            return str(self.here(text)) if is_address(text) else text

        try:
            given = with_strings_changed(row.data.get("given", {}), path_or_same)
        except VtoError as error:
            error.where = f"row {row.name}, {error.where}"
            raise
        return replace(row, data={**row.data, "given": given})

    def here(self, address: str) -> Path:
        """Return the path of the copy of what is at an address; it is copied only where it is not here as it is there.

        Raises:
            InputError, MissingDependencyError: as `io.stores`.
        """
        if address not in self._here:
            files = list_files(address)
            self._here[address] = self._known(address, files) or self._copied(address, files)
        return self._here[address]

    def remove_others(self, used: Collection[str], dry_run: bool = False) -> tuple[int, int]:
        """Remove the copies that are none of these paths, nor what they lie in; return how many and their size [B].

        Args:
            used: What rows were given.
            dry_run: Only count.
        """
        here, paths = self._folder.resolve(), [Path(one).resolve() for one in used]
        kept = {path.relative_to(here).parts[0] for path in paths if path.is_relative_to(here)}
        count = size = 0
        for copy in sorted(self._folder.glob("[!.]*/")):
            if copy.name in kept:
                continue
            count += 1
            size += sum(path.stat().st_size for path in copy.rglob("*") if path.is_file())
            if not dry_run:
                shutil.rmtree(copy)
        if count and not dry_run:
            self._index = {key: one for key, one in self._index.items() if (self._folder / str(one["path"])).exists()}
            write_json(self._folder / INDEX, self._index)
        return count, size

    def _known(self, address: str, files: Sequence[RemoteFile]) -> Path | None:
        entry = self._index.get(address)
        if entry is None or entry["files"] != [asdict(one) for one in files] or not all(one.version for one in files):
            return None
        path = self._folder / str(entry["path"])
        return path if path.exists() else None

    def _copied(self, address: str, files: Sequence[RemoteFile]) -> Path:
        name = _plain(PurePosixPath(unquote(urlsplit(address).path)).name or urlsplit(address).netloc)
        partial = self._folder / f".{os.getpid()}{_PARTIAL}"
        beside = partial / name
        self._say(f"copying {address}: {len(files)} file{'s' if len(files) > 1 else ''}")
        try:
            for file in files:
                copy_here(address, file, beside / file.name)
            digest = digest_path(beside)[:32]
            path = self._folder / digest / name
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                os.replace(beside, path)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        self._index[address] = {"path": f"{digest}/{name}", "files": [asdict(one) for one in files]}
        write_json(self._folder / INDEX, self._index)
        return path


def _plain(name: str) -> str:
    """Return a name as a file here may have it; its suffix, which tells its format, is as it was."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", name).lstrip(".")[-100:] or "input"
