"""Running a plan: each stage from its cached result, or made, recorded and published."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vto_pipeline.errors import ComputationError, ConfigError, InputError, VtoError
from vto_pipeline.io.documents import suggest
from vto_pipeline.io.stalls import told_if_stalled
from vto_pipeline.model.job import Job
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.budget import Budget, TimeBudget, can_stop, check_memory
from vto_pipeline.pipeline.execution.cost import Meter
from vto_pipeline.pipeline.execution.cost_model import TIMED
from vto_pipeline.pipeline.execution.digest import digest_given
from vto_pipeline.pipeline.execution.final import make_final
from vto_pipeline.pipeline.execution.folder import RECORD, locked_run_folder
from vto_pipeline.pipeline.execution.forecast import stored_results
from vto_pipeline.pipeline.execution.key import result_key, time_key
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.out import OutputFolder, write_value
from vto_pipeline.pipeline.execution.record import RunRecord, StageRecord, final_seconds
from vto_pipeline.pipeline.execution.store import Result, Store
from vto_pipeline.pipeline.levels import DEFAULT
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request


def run(
    request: Request,
    plan: Plan,
    catalogue: Catalogue,
    folder: Path,
    *,
    force_all: bool = False,
    listener: Listener | None = None,
    cache: Path | None = None,
    afresh: str | None = None,
    time_budget: TimeBudget | None = None,
    memory: float | None = None,
) -> dict[str, Any]:
    """Run a plan in a folder, resuming from the results of earlier runs.

    Args:
        request: What is given.
        plan: What to do.
        catalogue: The tables.
        folder: RUN; made if need be.
        force_all: Leave nothing out, for comparing.
        listener: Receives how it goes.
        cache: Where results are kept, which several runs may share; None: in the run's folder.
        afresh: Stage that is made anew, with all that depends on it, though results are stored.
        time_budget: Of the whole run: stages are run at levels that fit, and what is left is the budget of one that can
            stop in time. None: each has what its settings say.
        memory: Budget of the process's resident memory [B], for each stage; None: what the machine has.

    Returns:
        What run.json holds.

    Raises:
        ConfigError: the folder is in use, or is no run's folder; the plan has no stage `afresh`; or a stage took more
            than `memory` in earlier runs.
        InputError: something given cannot be read.
        ComputationError: a stage failed; its partial result is under RUN/out/partial.
    """
    renewed = _dependents(afresh, plan) if afresh is not None else frozenset()
    with locked_run_folder(folder, [path for one in request.given.values() for path in one.paths]):
        store = Store(folder / "cache" if cache is None else cache)
        finals = final_seconds(folder / RECORD, plan)
        budget = None
        if time_budget is not None:
            ready = [step.stage.name for step, found in stored_results(request, plan, store, force_all) if found]
            budget = Budget(time_budget, request, plan, store, finals, set(ready) - renewed)
        if memory is not None:
            check_memory(memory, request, plan, store, force_all, renewed)
        runner = _Run(
            request, plan, catalogue, folder, store, force_all, listener or Listener(), renewed, budget, memory
        )
        return runner.run_all()


def _dependents(name: str, plan: Plan) -> frozenset[str]:
    """Return a stage of the plan and all stages that what it makes leads to."""
    if name not in [step.stage.name for step in plan.steps]:
        left_out = f"it is left out: {plan.left_out[name]}" if name in plan.left_out else ""
        hint = left_out or suggest(name, [step.stage.name for step in plan.steps])
        raise ConfigError(f"the document does not run {name!r}", hint=hint)
    found = {name}
    for step in plan.steps:  # each after the makers of its inputs
        if any(plan.makers.get(artifact) in found for artifact in step.inputs):
            found.add(step.stage.name)
    return frozenset(found)


class _Run:
    """One run in progress."""

    def __init__(
        self,
        request: Request,
        plan: Plan,
        catalogue: Catalogue,
        folder: Path,
        store: Store,
        force_all: bool,
        listener: Listener,
        renewed: frozenset[str],
        budget: Budget | None,
        memory: float | None,
    ) -> None:
        self.request, self.plan, self.catalogue = request, plan, catalogue
        self.force_all, self.listener, self.renewed = force_all, listener, renewed
        self.store, self.budget = store, budget
        self.memory = math.inf if memory is None else memory
        self.out = OutputFolder(folder / "out", catalogue)
        self.record = RunRecord(folder / RECORD, request, plan, None if budget is None else budget.whole, memory)
        self.results: dict[str, Result] = {}
        self.given_digests: dict[str, str] = {}
        self.done_again: dict[str, str] = {}

    def run_all(self) -> dict[str, Any]:
        """Run all stages in order; the final ones also after a failure, so that there is a page.

        Where a stage fails on what a time budget made of those before it, these are done again.
        """
        self.store.sweep()
        self.out.open()
        self.record.save()
        steps = list(enumerate(self.plan.steps, start=1))
        waiting = [(n, s) for n, s in steps if not s.stage.final]
        try:
            while waiting:
                number, step = waiting.pop(0)
                try:
                    self._guard(number, step)
                except ComputationError as error:
                    again = self._finer(step, error)
                    if not again:
                        raise
                    waiting = [(n, s) for n, s in steps[:number] if s.stage.name in again] + waiting
        except ComputationError as error:
            if error.partial:
                self.out.put_partial(error.partial)
            self._finals([(n, s) for n, s in steps if s.stage.final and not s.stage.needs])
            raise
        else:
            self._finals([(n, s) for n, s in steps if s.stage.final])
        finally:
            self.out.tidy()
        return self.record.as_dict()

    def _guard(self, number: int, step: Step) -> None:
        """Run one stage and record how it ends."""
        record = self.record.stages[step.stage.name]
        try:
            self._do(number, step, record)
        except VtoError as error:
            error.where = error.where or f"stage {step.stage.name}"
            record.status, record.reason = "failed", error.problem
            raise
        except OSError as error:  # a full disk, say; what can no longer be recorded is still told
            record.status, record.reason = "failed", str(error.strerror)
            raise
        finally:
            if record.status != "cached":  # of what takes no time the next record tells, or the last
                with told_if_stalled(self.out.folder.parent, self.listener.warned):
                    self.record.save()
            self.listener.ended(number, len(self.plan.steps), record)

    def _finer(self, step: Step, error: ComputationError) -> frozenset[str]:
        """Return the stages to do again, as one failed on what was made for it in haste; maybe none."""
        if self.budget is None:
            return frozenset()
        name, names = step.stage.name, [one.stage.name for one in self.plan.steps]
        poor = self.budget.finer([one for one in names if one != name and name in _dependents(one, self.plan)])
        again = frozenset[str]().union(*(_dependents(one, self.plan) for one in poor))
        self.renewed |= poor.keys()
        self.done_again |= {one: f"{said}, as {name} failed: {error.problem}" for one, said in poor.items()}
        for one in again:
            self.record.stages[one] = StageRecord(one, figures=self.record.stages[one].figures)
        return again

    def _do(self, number: int, step: Step, record: StageRecord) -> None:
        name = step.stage.name
        digests = {artifact: self._digest(artifact) for artifact in step.inputs}
        record.key = self._key(step, digests)
        with self.store.claimed(name, record.key):
            result = None if name in self.renewed else self.store.find(name, record.key)
            if result is None:
                self.listener.started(number, len(self.plan.steps), step.stage)
                result = self._make(step, record)
                record.status = "ran"
            else:
                record.recall(result.record)
                record.status = "cached"
                if self.budget is not None:
                    self.budget.found(name, record.level, record.seconds)
        record.reason = result.record["reason"]
        if record.reason:
            record.status = "left_out"
        mine = [artifact for artifact in step.stage.makes if self.plan.makers.get(artifact) == name]
        self.results.update(dict.fromkeys(mine, result))
        with told_if_stalled(self.out.folder, self.listener.warned):
            self.out.publish(result, mine)

    def _key(self, step: Step, digests: dict[str, str]) -> str:
        """Return the key of a stage's result: with the budget in it if that counts and no result is stored without."""
        name, seed = step.stage.name, self.request.seed
        plain = result_key(step, digests, seed, self.force_all)
        if self.budget is None or not self.budget.adapts(step):
            return plain
        hurried = result_key(step, digests, seed, self.force_all, self.budget.whole.seconds)
        if name not in self.renewed:
            for key in (plain, hurried):
                if self.store.find(name, key) is not None:
                    return key
        return plain if self.budget.level(step) is DEFAULT and not can_stop(step) else hurried

    def _make(self, step: Step, record: StageRecord) -> Result:
        """Read the inputs, call the stage, write what it returns."""
        name, meter = step.stage.name, Meter()
        with self.store.making(name) as unfinished, self.store.making(name) as scratch:
            if name in self.renewed:
                self.store.discard_kept(name, record.key)
            job = Job(self.listener.progress, scratch, self.request.seed, self.force_all, self.memory)
            job.kept = self.store.kept(name, record.key) if step.stage.piecewise else None
            try:
                with self._unchanged(step):
                    outputs, reason = self._call(step, job, record)
            finally:
                record.take(job, meter)
            with told_if_stalled(self.store.folder, self.listener.warned):
                for artifact in step.stage.makes:
                    write_value(self.catalogue.kind(artifact), outputs[artifact], unfinished)
                record.take(job, meter)
                if self.budget is not None:
                    record.share = self.budget.ran(step, record.seconds)
                files = {artifact: self.catalogue.kind(artifact).filename for artifact in step.stage.makes}
                told = asdict(record) | {"reason": reason, TIMED: time_key()}
                return self.store.finish(unfinished, name, record.key, files, told)

    def _call(self, step: Step, job: Job, record: StageRecord) -> tuple[dict[str, Any], str]:
        """Outputs by artifact, and the reason if the stage was skipped."""
        if self.budget is None:
            return self._work(step, job)
        for text in filter(None, (self.done_again.get(step.stage.name), self.budget.shortage())):
            job.warn(text)
            self.listener.warned(text)
        level = self.budget.level(step)
        if level is DEFAULT:
            return self._work(step, job)
        try:
            record.level = {"settings": dict(level.settings), "error": level.error}
            return self._work(step.changed(level.settings), job)
        except ComputationError as error:
            record.level = {}
            self.budget.by_default(step)
            job.warn(f"what would have saved time did not do: {error.problem}")
            return self._work(step, job)

    def _work(self, step: Step, job: Job) -> tuple[dict[str, Any], str]:
        inputs = {artifact: self._read(artifact, job) for artifact in step.inputs}
        skip = None if self.force_all else step.stage.skip
        reason = skip(inputs) if skip is not None else None
        if reason:
            return {made: inputs[source] for made, source in step.stage.passes.items()}, reason
        settings = step.settings if self.budget is None else self.budget.share(step, job)
        outputs = dict(step.stage.run(inputs, settings, job))
        if set(outputs) != set(step.stage.makes):
            raise TypeError(f"stage {step.stage.name} returned {sorted(outputs)}, promised {sorted(step.stage.makes)}")
        return outputs, ""

    @contextmanager
    def _unchanged(self, step: Step) -> Iterator[None]:
        """Refuse what a stage makes, or says, of given files that have changed since their digest was taken."""
        try:
            yield
        except Exception:
            self._check_given(step)
            raise
        self._check_given(step)

    def _check_given(self, step: Step) -> None:
        for artifact in step.inputs:
            if artifact not in self.given_digests:
                continue  # made by another stage
            one = self.request.given[artifact]
            if digest_given(one) != self.given_digests[artifact]:
                raise InputError(
                    f"given.{one.key} has changed while it was read",
                    where=", ".join(map(str, one.paths)),
                    hint="run the same command again when it is complete",
                )

    def _finals(self, steps: list[tuple[int, Step]]) -> None:
        if self.budget is not None:
            self.record.bought = self.budget.summary()
        for number, step in steps:
            record, meter = self.record.stages[step.stage.name], Meter()
            self.listener.started(number, len(self.plan.steps), step.stage)
            job = Job(self.listener.progress, None, self.request.seed, self.force_all, self.memory)
            make_final(step.stage, step.settings, self.out, self.request.given, self.record.as_dict(), job)
            record.take(job, meter)
            record.status = "ran"
            self.listener.ended(number, len(self.plan.steps), record)
        self.record.save()

    def _read(self, artifact: str, job: Job) -> Any:
        """Return an input's value, always read from its file, so that a resumed run computes with the same bits."""
        if artifact in self.results:
            return self.catalogue.kind(artifact).read(self.results[artifact].path(artifact))
        return self.request.given[artifact].read(job)

    def _digest(self, artifact: str) -> str:
        if artifact in self.results:
            return self.results[artifact].digest(artifact)
        if artifact not in self.given_digests:
            self.given_digests[artifact] = digest_given(self.request.given[artifact])
        return self.given_digests[artifact]
