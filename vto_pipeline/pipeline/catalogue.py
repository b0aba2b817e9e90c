"""The tables of the engine: stages, kinds of artifact, and keys that may be given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vto_pipeline.errors import InputError
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Stages, artifacts and inputs. Every cross-reference is checked when it is built.

    Equal only to itself, so that what follows from a catalogue can be kept by it.

    Args:
        stages: In the order in which people think of them; the order of a plan where its needs leave a choice.
        kinds: Every artifact.
        given: Key in a document, such as "garment.photos" or "fabric" -> artifact.

    Raises:
        ValueError: a table contradicts itself; a bug, not a user's mistake.
    """

    stages: tuple[Stage, ...]
    kinds: tuple[ArtifactKind, ...]
    given: Mapping[str, str]

    def __post_init__(self) -> None:
        names = [kind.name for kind in self.kinds]
        _refuse_duplicates("artifact", names)
        _refuse_duplicates("stage", [stage.name for stage in self.stages])
        made = {artifact for stage in self.stages for artifact in stage.makes}
        files = [k.filename for k in self.kinds if k.name in made]
        _refuse_duplicates("file name", files + [name for k in self.kinds for name, _ in k.previews])
        named = {a for stage in self.stages for a in (*stage.needs, *stage.makes, *stage.optional)}
        unknown = (named | set(self.given.values())) - set(names)
        if unknown:
            raise ValueError(f"artifacts without a kind: {sorted(unknown)}")
        for stage in self.stages:
            if self.sections[stage.section] is not stage.settings:
                raise ValueError(f"two settings classes for stages.{stage.section}")

    @property
    def sections(self) -> dict[str, type[Config]]:
        """Key under `stages:` in a document -> settings class."""
        found: dict[str, type[Config]] = {}
        for stage in self.stages:
            found.setdefault(stage.section, stage.settings)
        return found

    def kind(self, artifact: str) -> ArtifactKind:
        """The kind of an artifact that exists."""
        for kind in self.kinds:
            if kind.name == artifact:
                return kind
        raise InputError(f"no such artifact: {artifact}", hint="run the document again with this version")

    def makers(self, artifact: str) -> list[Stage]:
        """Stages that make an artifact."""
        return [stage for stage in self.stages if artifact in stage.makes]

    def keys(self, artifact: str) -> list[str]:
        """Keys under `given:` that hold an artifact."""
        return [key for key, name in self.given.items() if name == artifact]


def _refuse_duplicates(what: str, names: list[str]) -> None:
    twins = sorted({name for name in names if names.count(name) > 1})
    if twins:
        raise ValueError(f"{what} named twice: {twins}")
