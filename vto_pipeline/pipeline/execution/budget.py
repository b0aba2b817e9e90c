"""The wall time of a run, and what of it is left for the stage that can stop in time; and the memory of a run."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from vto_pipeline.errors import ConfigError
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.execution.cost_model import CostModel, step_figures
from vto_pipeline.pipeline.execution.forecast import forecast
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request

SETTING = "time_budget_s"
"""A stage whose settings have this can stop in time; all others take as long as they take."""
_AT_LEAST = 0.001  # s; the setting is positive


@dataclass(frozen=True)
class TimeBudget:
    """The wall time that a run may take, from the time that this is made.

    Args:
        seconds: As chosen [s].
        began: `time.perf_counter` when the user began to wait.
    """

    seconds: float
    began: float = field(default_factory=time.perf_counter)

    @property
    def spent(self) -> float:
        """Wall time since it began [s]."""
        return time.perf_counter() - self.began


class Budget:
    """A time budget, shared out over the stages of one run.

    Args:
        whole: Of the run.
        request: What is given.
        plan: Its stages.
        store: Tells what later stages take, by the cost model; of one that never ran, nothing is kept back.
        finals: Stage -> time [s] of final stages when they last ran in this folder; the store has none of them.
    """

    def __init__(
        self, whole: TimeBudget, request: Request, plan: Plan, store: Store, finals: Mapping[str, float]
    ) -> None:
        self.whole, self._plan = whole, plan
        model, figures = CostModel(store), step_figures(request, plan)
        self._expected = {name: model.seconds(name, known) or 0.0 for name, known in figures.items()} | dict(finals)

    def left_for(self, step: Step) -> float:
        """Return what is left for a stage [s]: neither spent, nor needed by those after it; maybe less than none."""
        later = self._plan.steps[self._plan.steps.index(step) + 1 :]
        return self.whole.seconds - self.whole.spent - sum(self._expected[one.stage.name] for one in later)

    def share(self, step: Step, job: Job) -> Config:
        """Return a stage's settings, with what is left as its own budget if it can stop in time.

        The key of its result has the budget of the whole run, which is what was chosen.
        """
        if SETTING not in type(step.settings).model_fields:
            return step.settings
        left = self.left_for(step)
        job.measure(time_budget_s=round(left, 1))
        if left <= 0.0:
            job.warn(f"nothing is left for it of the time budget of {self.whole.seconds:g} s")
        return step.settings.model_copy(update={SETTING: max(left, _AT_LEAST)})


def check_memory(
    budget: float, request: Request, plan: Plan, store: Store, force_all: bool, renewed: Collection[str]
) -> None:
    """Refuse a run that would take more memory, by what its stages took before.

    Of a stage that never ran nothing is known, and one that fits itself into a budget is let begin.

    Args:
        budget: Of the process's resident memory [B].
        request, plan, store, force_all: Of the run.
        renewed: Stages that are made anew, though stored.

    Raises:
        ConfigError: a stage took more, for the size of what is given.
    """
    expected = forecast(request, plan, store, force_all)
    for step in plan.steps:
        name, known = step.stage.name, expected[step.stage.name]
        idle = step.stage.fits_memory or (known.stored and name not in renewed)
        if not idle and known.peak_mb is not None and 1e6 * known.peak_mb > budget:
            raise ConfigError(
                f"{name} takes about {known.peak_mb / 1e3:.3g} GB of memory, by earlier runs; "
                f"the budget is {budget / 1e9:.3g} GB",
                hint="give more memory, or less to do: `vto plan` shows what each stage takes",
            )
