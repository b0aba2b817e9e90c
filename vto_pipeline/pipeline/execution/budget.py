"""The wall time of a run, and what of it is left for the stage that can stop in time."""

from __future__ import annotations

import time

from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.execution.forecast import latest_record
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import Plan, Step

SETTING = "time_budget_s"
"""A stage whose settings have this can stop in time; all others take as long as they take."""
_AT_LEAST = 0.001  # s; the setting is positive


class Budget:
    """The budget of one run, from the time that this is made.

    Args:
        seconds: Wall time of the whole run [s].
        plan: Its stages.
        store: Tells what later stages took before; of one that never ran, nothing is kept back.
    """

    def __init__(self, seconds: float, plan: Plan, store: Store) -> None:
        self.seconds, self._plan, self._store = seconds, plan, store
        self._began = time.perf_counter()

    def left_for(self, step: Step) -> float:
        """Return what is left for a stage [s]: neither spent, nor needed by those after it; maybe less than none."""
        later = self._plan.steps[self._plan.steps.index(step) + 1 :]
        kept = sum(latest_record(self._store, one.stage.name).get("seconds", 0.0) for one in later)
        return self.seconds - (time.perf_counter() - self._began) - kept

    def share(self, step: Step, job: Job) -> Config:
        """Return a stage's settings, with what is left as its own budget if it can stop in time.

        The key of its result has the budget of the whole run, which is what was chosen.
        """
        if SETTING not in type(step.settings).model_fields:
            return step.settings
        left = self.left_for(step)
        job.measure(time_budget_s=round(left, 1))
        if left <= 0.0:
            job.warn(f"nothing is left for it of the time budget of {self.seconds:g} s")
        return step.settings.model_copy(update={SETTING: max(left, _AT_LEAST)})
