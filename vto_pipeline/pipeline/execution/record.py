"""run.json: what happened to every stage, and why. Rewritten after each stage."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import vto_pipeline
from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json, write_json
from vto_pipeline.model.job import Job
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.execution.cost import Meter, machine, thread_count
from vto_pipeline.pipeline.execution.cost_model import TIMED, step_figures
from vto_pipeline.pipeline.execution.key import time_key, versions
from vto_pipeline.pipeline.given import Given
from vto_pipeline.pipeline.plan import Plan
from vto_pipeline.pipeline.request import Request


@dataclass
class StageRecord:
    """One stage of a run.

    Args:
        name: The stage.
        status: "planned", "ran", "cached", "left_out" or "failed".
        reason: Why it was left out, or how it failed.
        seconds, peak_mb: Wall time [s], and largest resident memory of the whole process meanwhile [MB]; of the run
            that made it where cached.
        metrics: Figures it measured.
        notes, warnings: What it said; a warning is a verdict on a poor result.
        left_out: Parts of its work that this data did not need: (what, reason).
        key: Of its result.
        figures: What the plan knew of its work, from which its time is forecast.
        level: "settings" that a time budget chose, and their "error", as a multiple of that by default; or empty.
        share: Its time as a share of what it takes by default.
    """

    name: str
    status: str = "planned"
    reason: str = ""
    seconds: float = 0.0
    peak_mb: float = 0.0
    metrics: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    left_out: list[Any] = field(default_factory=list)
    key: str = ""
    figures: Mapping[str, float | str] = field(default_factory=dict)
    level: Mapping[str, Any] = field(default_factory=dict)
    share: float = 1.0

    def take(self, job: Job, meter: Meter) -> None:
        """Copy a job's messages, metrics and cost."""
        self.seconds, self.peak_mb = meter.seconds(), meter.peak_mb()
        self.metrics, self.notes, self.warnings = plain(job.metrics), list(job.notes), list(job.warnings)
        self.left_out = [list(pair) for pair in job.left_out]

    def recall(self, stored: Mapping[str, Any]) -> None:
        """Copy what was stored with a cached result."""
        for name in ("seconds", "peak_mb", "metrics", "notes", "warnings", "left_out", "level", "share"):
            setattr(self, name, stored.get(name, getattr(self, name)))


class RunRecord:
    """All of run.json, kept in step with the run. `bought` is what a time budget has to say at the end."""

    def __init__(
        self,
        path: Path,
        request: Request,
        plan: Plan,
        time_budget: TimeBudget | None = None,
        memory: float | None = None,
    ) -> None:
        self._path, self._meter, self._time_budget = path, Meter(), time_budget
        self.bought: dict[str, Any] = {}
        uses = sorted({name for step in plan.steps for name in step.stage.uses})
        figures = step_figures(request, plan)
        self.stages = {name: StageRecord(name, figures=known) for name, known in figures.items()}
        for name, reason in plan.left_out.items():
            self.stages[name] = StageRecord(name, "left_out", reason)
        self._head = {
            "schema": 1,
            "versions": {"vto-pipeline": vto_pipeline.__version__, **versions(uses)},
            "machine": machine(),
            "threads": thread_count(),
            TIMED: time_key(),
            "wanted": list(request.want),
            "given": {artifact: _given(one) for artifact, one in request.given.items()},
            "seed": request.seed,
            "time_budget_s": time_budget and time_budget.seconds,
            "memory_budget_mb": None if memory is None else memory / 1e6,
        }

    def as_dict(self) -> dict[str, Any]:
        """What run.json holds."""
        stages = [asdict(stage) for stage in self.stages.values()]
        spent = self._time_budget and round(self._time_budget.spent, 3)
        return {
            **self._head,
            "stages": stages,
            "seconds": self._meter.seconds(),
            "time_spent_s": spent,
            **self.bought,
        }

    def save(self) -> None:
        """Write run.json, whole or not at all."""
        write_json(self._path, self.as_dict())


def final_seconds(path: Path, plan: Plan) -> dict[str, float]:
    """Return what the final stages of a plan took when this build last ran them here [s], as far as run.json tells."""
    names = {step.stage.name for step in plan.steps if step.stage.final}
    try:
        record = read_json(path)
        ran = [one for one in record["stages"] if one["name"] in names and one["status"] == "ran"]
        return {one["name"]: float(one["seconds"]) for one in ran} if record[TIMED] == time_key() else {}
    except (InputError, KeyError, TypeError, ValueError):  # none yet, or not ours
        return {}


def plain(value: Any) -> Any:
    """Return the value in JSON form: arrays become lists; values that are not finite become null."""
    return json.loads(json.dumps(value, default=_listed), parse_constant=lambda _: None)


def _listed(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"a metric of type {type(value).__name__} has no JSON form")


def _given(one: Given) -> dict[str, Any]:
    name = "path" if isinstance(one.source, Path) else "value"
    return {"key": one.key, name: plain(one.source)}
