"""A stage is a row of a table: what it needs, what it makes, and its function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.levels import Level, UsualTime


@dataclass(frozen=True)
class Stage:
    """One step of a pipeline.

    Args:
        name: Identifier; a stage bound to a role is called "role.section", as in "garment.sfm".
        about: One line for people.
        needs: Artifacts without which it cannot run.
        makes: Artifacts it returns, all of them, every time.
        run: (inputs by artifact, settings, job) -> outputs by artifact.
        settings: Its settings class; stages of one section share it.
        optional: Artifacts it takes when they can be made from what is given. They are absent from the inputs when not.
            A final stage takes those that the rest of the plan holds, and causes none to be made.
        uses: Distributions whose version changes the result, such as "pycolmap".
        skip: Inputs -> the reason why this data does not need the stage, or None. Must be conservative.
        passes: Made artifact -> needed artifact whose file it takes when the stage is skipped.
        final: Runs last, every time, uncached; its inputs also hold "run_record", the dict that run.json holds.
        fits_memory: It works in what `Job.memory_left` says, or refuses in words.
        piecewise: It keeps what it has made in `Job.kept`, and begins with what is there.
        idle: Settings -> those of the optional artifacts that it has no use for under these.
        levels: What a run with a time budget may run it at instead of by default.
        usual: What it takes by default, where it has never run.
    """

    name: str
    about: str
    needs: tuple[str, ...]
    makes: tuple[str, ...]
    run: Callable[[Mapping[str, Any], Any, Job], Mapping[str, Any]]
    settings: type[Config] = Config
    optional: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    skip: Callable[[Mapping[str, Any]], str | None] | None = None
    passes: Mapping[str, str] = field(default_factory=dict)
    final: bool = False
    fits_memory: bool = False
    piecewise: bool = False
    idle: Callable[[Any], tuple[str, ...]] = lambda settings: ()
    levels: tuple[Level, ...] = ()
    usual: UsualTime | None = None

    def __post_init__(self) -> None:
        if self.skip is not None and set(self.passes) != set(self.makes):
            raise ValueError(f"stage {self.name} can be skipped: passes must name a source for each of {self.makes}")
        if not set(self.passes.values()) <= set(self.needs):
            raise ValueError(f"stage {self.name}: passes may only name what it needs, {self.needs}")

    def extras(self, settings: Config) -> tuple[str, ...]:
        """Return the optional artifacts that it uses under these settings, if available."""
        idle = self.idle(settings)
        return tuple(artifact for artifact in self.optional if artifact not in idle)

    @property
    def section(self) -> str:
        """Key of its settings under `stages:` in a document; shared by the roles."""
        return self.name.rpartition(".")[2]
