"""Results on disk: a folder with a manifest written last and renamed into place. No manifest, no result.

Several runs may share a store: what one of them makes, the others wait for. All locks are the operating system's, so
that a killed run leaves none.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vto_pipeline.io.documents import write_json
from vto_pipeline.pipeline.execution.digest import digest_file

MANIFEST = "manifest.json"
_UNFINISHED = ".unfinished-"
_KEPT = ".kept"


@dataclass(frozen=True)
class Result:
    """A stored result of a stage.

    Args:
        folder: Where its files lie.
        outputs: Artifact -> file name.
        digests: File name -> SHA-256, for outputs and previews.
        record: What was said and measured when it was made.
    """

    folder: Path
    outputs: Mapping[str, str]
    digests: Mapping[str, str]
    record: Mapping[str, Any]

    def path(self, artifact: str) -> Path:
        """File of an artifact."""
        return self.folder / self.outputs[artifact]

    def digest(self, artifact: str) -> str:
        """Content digest of an artifact."""
        return self.digests[self.outputs[artifact]]


class Store:
    """Results of one run, or of several that share them, by stage and key."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, stage: str, key: str) -> Result | None:
        """A finished result, or None."""
        folder = self.folder / stage / key
        try:
            manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
            whole = all((folder / name).stat().st_size == size for name, size in manifest["sizes"].items())
        except (FileNotFoundError, ValueError):
            return None
        return Result(folder, manifest["outputs"], manifest["digests"], manifest["record"]) if whole else None

    @contextmanager
    def claimed(self, stage: str, key: str) -> Iterator[None]:
        """Wait until no other run makes this result, and keep others from making it."""
        (self.folder / stage).mkdir(parents=True, exist_ok=True)
        with (self.folder / stage / f".{key}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    @contextmanager
    def making(self, stage: str) -> Iterator[Path]:
        """A folder to make a result in; gone afterwards unless `finish` moved it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with self._beginning(fcntl.LOCK_SH):
            folder = Path(tempfile.mkdtemp(prefix=f"{_UNFINISHED}{stage}-", dir=self.folder))
            held = os.open(folder, os.O_RDONLY)
            fcntl.flock(held, fcntl.LOCK_EX)
        try:
            yield folder
        finally:
            os.close(held)
            shutil.rmtree(folder, ignore_errors=True)

    def kept(self, stage: str, key: str) -> Path:
        """Return where a stage may keep what it has made so far, for a run that goes on from there; made if need be.

        It is gone once the result is finished.
        """
        folder = self.folder / stage / f"{key}{_KEPT}"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def discard_kept(self, stage: str, key: str) -> None:
        """Remove what an interrupted run kept of a stage."""
        shutil.rmtree(self.folder / stage / f"{key}{_KEPT}", ignore_errors=True)

    def finish(
        self, unfinished: Path, stage: str, key: str, outputs: Mapping[str, str], record: Mapping[str, Any]
    ) -> Result:
        """Seal a folder: digest its files, write the manifest, rename it into place."""
        files = sorted(path for path in unfinished.iterdir())
        digests = {path.name: digest_file(path) for path in files}
        sizes = {path.name: path.stat().st_size for path in files}
        manifest = {"outputs": dict(outputs), "digests": digests, "sizes": sizes, "record": dict(record)}
        write_json(unfinished / MANIFEST, manifest)
        folder = self.folder / stage / key
        folder.parent.mkdir(exist_ok=True)
        shutil.rmtree(folder, ignore_errors=True)  # what `find` did not accept
        os.replace(unfinished, folder)
        self.discard_kept(stage, key)
        return Result(folder, dict(outputs), digests, dict(record))

    def remove_others(self, keys: Collection[tuple[str, str]], dry_run: bool = False) -> tuple[int, int]:
        """Remove every result but some, none that a run at work is making or has claimed.

        Args:
            keys: Stage and key of each result that stays.
            dry_run: Only count.

        Returns:
            How many results were removed, and how many bytes they held.
        """
        count = size = 0
        for folder in sorted(self.folder.glob("*/*")):
            if not folder.is_dir() or folder.parent.name.startswith(".") or (folder.parent.name, folder.name) in keys:
                continue
            key = folder.name.removesuffix(_KEPT)
            with (folder.parent / f".{key}.lock").open("w") as lock, suppress(BlockingIOError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                count, size = count + 1, size + sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
                if not dry_run:
                    shutil.rmtree(folder, ignore_errors=True)
        return count, size

    def sweep(self) -> None:
        """Remove what interrupted runs left, and nothing that a run at work is making."""
        unfinished = list(self.folder.glob(f"{_UNFINISHED}*"))
        if not unfinished:
            return
        with suppress(BlockingIOError), self._beginning(fcntl.LOCK_EX | fcntl.LOCK_NB):
            for folder in unfinished:
                with suppress(OSError):  # held by its run, or just gone
                    held = os.open(folder, os.O_RDONLY)
                    try:
                        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        shutil.rmtree(folder, ignore_errors=True)
                    finally:
                        os.close(held)

    @contextmanager
    def _beginning(self, operation: int) -> Iterator[None]:
        """Hold the lock between the making of an unfinished folder and its being held, when it looks abandoned."""
        with (self.folder / ".lock").open("w") as lock:
            fcntl.flock(lock, operation)
            yield
