"""What a run made, and what it says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json
from vto_pipeline.notebook import Presented
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.folder import RECORD, existing_run
from vto_pipeline.stages.entry import planning


@dataclass(frozen=True)
class Outcome(Presented):
    """A finished run.

    Args:
        folder: RUN.
        record: What its run.json holds.
        tables: That it was made with.
    """

    folder: Path
    record: Mapping[str, Any]
    tables: Catalogue

    @property
    def seconds(self) -> float:
        """Wall time of the whole run [s]."""
        return float(self.record["seconds"])

    @property
    def warnings(self) -> list[tuple[str, str]]:
        """Stage and text of each verdict on a poor result."""
        return [(stage["name"], text) for stage in self.record["stages"] for text in stage["warnings"]]

    @property
    def verdicts(self) -> list[str]:
        """How each garment fits, in words."""
        found = []
        for artifact in self.record["wanted"]:
            if artifact.endswith("fit_report") and self.made(artifact):
                garment = artifact.removesuffix("fit_report").rstrip("_")
                found.append(f"fit{f' of {garment}' if garment else ''}: {self.read(artifact)['verdict']}")
        if "motion_report" in self.record["wanted"] and self.made("motion_report"):
            found.append(self.read("motion_report")["verdict"])
        if "pose_report" in self.record["wanted"] and self.made("pose_report"):
            found += [record["verdict"] for record in self.read("pose_report")["poses"]]
        return found

    @property
    def files(self) -> list[Path]:
        """Its record, and the files of what was wanted."""
        return [self.folder / RECORD, *(self.path(name) for name in self.record["wanted"] if self.made(name))]

    def made(self, artifact: str) -> bool:
        """Whether there is a file of an artifact.

        A run that was interrupted or failed has not made all it should, and not every table knows every artifact.

        Raises:
            InputError: a later run of other things has replaced in the folder what this one made.
        """
        self._check_current()
        known = next((kind for kind in self.tables.kinds if kind.name == artifact), None)
        return known is not None and (self.folder / "out" / known.filename).is_file()

    def path(self, artifact: str) -> Path:
        """Return the file of an artifact.

        Raises:
            InputError: the run made none, or a later run has replaced it.
        """
        if not self.made(artifact):
            raise InputError(f"this run made no {artifact}", where=str(self.folder))
        return self.folder / "out" / self.tables.kind(artifact).filename

    def read(self, artifact: str) -> Any:
        """Return the value of an artifact: a mesh, an avatar, measurements, a report.

        Raises:
            InputError: the run made none, or a later run has replaced it.
        """
        return self.tables.kind(artifact).read(self.path(artifact))

    def _check_current(self) -> None:
        """Refuse to give what another run has made in the folder since, as where two calls name no folder."""
        path = self.folder / RECORD
        if path.is_file() and _results_there(path, path.stat().st_mtime_ns) != _results(self.record):
            problem = "a later run has replaced what this one made"
            raise InputError(problem, where=str(self.folder), hint="give each run an output folder of its own")


def _results(record: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return what tells the results of a run: each stage, and the key of what it made."""
    return tuple((stage["name"], stage.get("key", "")) for stage in record["stages"])


@lru_cache(maxsize=64)
def _results_there(path: Path, changed: int) -> tuple[tuple[str, str], ...]:
    """Return them of the record at a path, as it was at some time [ns]."""
    return _results(read_json(path))


def open_run(folder: Path | str) -> Outcome:
    """Return what an earlier run made.

    Args:
        folder: RUN.

    Raises:
        InputError: it is not the folder of a run.
    """
    folder = Path(folder)
    return Outcome(folder, read_json(existing_run(folder) / RECORD), planning.run_tables(folder, planning.catalogue()))
