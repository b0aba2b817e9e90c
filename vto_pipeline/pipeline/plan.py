"""Planning backwards from the wanted artifacts to the given ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from vto_pipeline.errors import PlanError
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.lacking import lacking, reachable
from vto_pipeline.pipeline.request import Request
from vto_pipeline.pipeline.stage import Stage


@dataclass(frozen=True)
class Step:
    """A stage with all choices made.

    Args:
        stage: The row of the table.
        inputs: Artifacts it will get: its needs and those of its optional inputs that can be had.
        settings: Checked, with defaults.
    """

    stage: Stage
    inputs: tuple[str, ...]
    settings: Config

    def changed(self, settings: Mapping[str, Any]) -> Step:
        """Return the step with other values of some settings, and without the inputs that these leave idle."""
        new = type(self.settings).model_validate({**self.settings.model_dump(exclude_unset=True), **settings})
        used = {*self.stage.needs, *self.stage.extras(new)}
        return replace(self, settings=new, inputs=tuple(name for name in self.inputs if name in used))


@dataclass(frozen=True)
class Plan:
    """What will run, in order, and what will not, with the reason.

    Args:
        steps: Each after the makers of its inputs; final stages last.
        left_out: Stage name -> reason, in the order of the table.
        makers: Artifact -> name of the stage that makes it.
    """

    steps: tuple[Step, ...]
    left_out: dict[str, str]
    makers: dict[str, str]


def make_plan(request: Request, catalogue: Catalogue) -> Plan:
    """Find the stages that lead from the given artifacts to the wanted ones.

    Raises:
        PlanError: something wanted cannot be made, and the missing leaf is named; or two stages could make an artifact
            and the document does not choose.
    """
    makers = _Walk(request, catalogue).makers
    taken = {stage.name: stage for stage in makers.values()}
    held = set(request.given) | {made for stage in taken.values() if not stage.final for made in stage.makes}
    for stage in taken.values():
        for artifact in stage.makes:  # what a stage makes besides is there for all
            if artifact not in request.given:
                makers.setdefault(artifact, stage)
    steps = tuple(
        _step(stage, held, request.settings[stage.section])
        for stage in _in_order([stage for stage in catalogue.stages if stage.name in taken], makers)
    )
    left_out = {s.name: _reason(s, makers, request, catalogue) for s in catalogue.stages if s.name not in taken}
    return Plan(steps, left_out, {artifact: stage.name for artifact, stage in makers.items()})


def _step(stage: Stage, held: set[str], settings: Config) -> Step:
    return Step(stage, (*stage.needs, *(a for a in stage.extras(settings) if a in held)), settings)


class _Walk:
    """The search; `makers` is its result: artifact -> the stage that was picked for it."""

    def __init__(self, request: Request, catalogue: Catalogue) -> None:
        self.request, self.catalogue = request, catalogue
        self.makers: dict[str, Stage] = {}
        self.able = reachable(request.given, catalogue)
        for artifact in request.want:
            if artifact not in self.able:
                raise _cannot(artifact, request, catalogue)
        for artifact in request.want:
            self._need(artifact)

    def _need(self, artifact: str) -> None:
        chosen = self.request.choose.get(artifact)
        if artifact in self.makers or (artifact in self.request.given and chosen is None):
            return
        stage = self._pick(artifact)
        self.makers[artifact] = stage
        for need in stage.needs:
            self._need(need)
        for need in () if stage.final else stage.extras(self.request.settings[stage.section]):
            if need in self.able:
                self._need(need)

    def _pick(self, artifact: str) -> Stage:
        """The only stage that can make an artifact from what is given, or the chosen one."""
        rest = reachable(self.request.given, self.catalogue, without=artifact)
        able = [stage for stage in self.catalogue.makers(artifact) if rest.issuperset(stage.needs)]
        chosen = self.request.choose.get(artifact)
        if chosen is not None:
            able = [stage for stage in able if stage.name == chosen]
            if not able:
                raise _cannot(artifact, self.request, self.catalogue, chosen)
        if len(able) > 1:
            settled = {stage.name for stage in self.makers.values()} | set(self.request.choose.values())
            able = [stage for stage in able if stage.name in settled] or able
        if len(able) > 1:
            names = [stage.name for stage in able]
            raise PlanError(
                f"{artifact} can be made in {len(names)} ways: by {' or '.join(names)}",
                where=self.request.places.get("given", ""),
                hint=f"add to the document   choose: {{{artifact}: {names[0]}}}   or give fewer inputs",
            )
        return able[0]


def _cannot(artifact: str, request: Request, catalogue: Catalogue, stage: str | None = None) -> PlanError:
    """Return the error for missing inputs, by the keys a user would write."""
    groups = lacking(artifact, request.given, catalogue, only=stage)
    sections = [" or ".join(dict.fromkeys(key.partition(".")[0] for key in group)) for group in groups]
    choices = [f"one of {', '.join(group)}" if len(group) > 1 else group[0] for group in groups]
    by = f" by {stage}" if stage else ""
    return PlanError(
        f"{artifact} cannot be made{by}: {' and '.join(sections)} not given",
        where=request.places.get(artifact, request.places.get("given", "")),
        hint=f"give {', and '.join(choices)}",
    )


def _in_order(taken: list[Stage], makers: dict[str, Stage]) -> Iterable[Stage]:
    """Stages in the order of the table, each moved behind the makers of its inputs."""
    waiting = [stage for stage in taken if not stage.final]
    while waiting:
        late = {stage.name for stage in waiting}
        ready = [s for s in waiting if not any(a in makers and makers[a].name in late for a in (*s.needs, *s.optional))]
        if not ready:
            raise PlanError(f"stages depend on each other in a loop: {', '.join(sorted(late))}")
        waiting.remove(ready[0])
        yield ready[0]
    yield from (stage for stage in taken if stage.final)


def _reason(stage: Stage, makers: dict[str, Stage], request: Request, catalogue: Catalogue) -> str:
    """Why a stage is not in the plan."""
    for artifact in stage.makes:
        if artifact in request.given:
            return f"{request.given[artifact].key} is given"
    missing = [n for n in stage.needs if n not in reachable(request.given, catalogue)]
    if missing:
        keys = [key for group in lacking(missing[0], request.given, catalogue)[:1] for key in group]
        return f"{keys[0]} not given" if len(keys) == 1 else f"none of {', '.join(keys)} given"
    rival = next((makers[artifact].name for artifact in stage.makes if artifact in makers), None)
    if rival is not None:
        return f"not chosen: {rival} makes it"
    return "nothing wanted depends on it"
