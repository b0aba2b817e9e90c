"""RUN/out: the artifacts of the latest run under fixed names, each replaced whole."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.io.files import remove_partial
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.digest import digest_file
from vto_pipeline.pipeline.execution.store import Result


class OutputFolder:
    """The folder of results for users."""

    def __init__(self, folder: Path, catalogue: Catalogue) -> None:
        self.folder, self.partial = folder, folder / "partial"
        self._catalogue = catalogue
        self._current: set[str] = set()

    def publish(self, result: Result, artifacts: Collection[str]) -> None:
        """Copy a result's files; those already there stay untouched."""
        for kind in map(self._catalogue.kind, artifacts):
            for name in file_names(kind):
                self._current.add(name)
                target = self.folder / name
                if not (target.is_file() and digest_file(target) == result.digests[name]):
                    with tempfile.TemporaryDirectory(prefix=".", dir=self.folder) as beside:
                        os.replace(shutil.copyfile(result.folder / name, Path(beside) / name), target)

    def put(self, values: Mapping[str, Any]) -> None:
        """Write artifacts straight into the folder."""
        self._current.update(self._write(values, self.folder))

    def put_partial(self, values: Mapping[str, Any]) -> None:
        """Keep the partial result of a failed stage, apart from complete artifacts."""
        self._write(values, self.partial)

    def _write(self, values: Mapping[str, Any], folder: Path) -> list[str]:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=folder) as beside:
            for artifact, value in values.items():
                write_value(self._catalogue.kind(artifact), value, Path(beside))
            names = [path.name for path in Path(beside).iterdir()]
            for name in names:
                os.replace(Path(beside) / name, folder / name)
        return names

    def find(self, artifacts: Iterable[str]) -> dict[str, Any]:
        """Read the artifacts that exist, complete or partial."""
        found = {}
        for kind in map(self._catalogue.kind, artifacts):
            paths = [folder / kind.filename for folder in (self.partial, self.folder)]
            path = next((path for path in paths if path.is_file()), None)  # a folder where the kind has no file
            if path is not None:
                found[kind.name] = kind.read(path)
        return found

    def open(self) -> None:
        """Create the folder, and remove the partial results of a failed run."""
        self.folder.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(self.partial, ignore_errors=True)
        remove_partial(self.folder)
        for rest in self.folder.glob(".*"):
            shutil.rmtree(rest, ignore_errors=True)

    def tidy(self) -> None:
        """Remove artifacts of earlier runs that this one did not make, so that old and new never stand side by side."""
        for kind in self._catalogue.kinds:
            for name in file_names(kind):
                if name not in self._current:
                    (self.folder / name).unlink(missing_ok=True)


def file_names(kind: ArtifactKind) -> tuple[str, ...]:
    """Return the artifact's file and its previews; none if it can only be given."""
    return tuple(name for name in (kind.filename, *(name for name, _ in kind.previews)) if name)


def write_value(kind: ArtifactKind, value: Any, folder: Path) -> None:
    """Write an artifact and its previews."""
    kind.write(folder / kind.filename, value)
    for name, write in kind.previews:
        write(folder / name, value)
