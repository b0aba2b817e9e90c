"""The wall time of a run, and what of it is left for the stage that can stop in time; and the memory of a run."""

from __future__ import annotations

import time
from collections.abc import Collection, Sequence

import numpy as np

from vto_pipeline.errors import ConfigError
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.execution.forecast import forecast, latest_record
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request

SETTING = "time_budget_s"
"""A stage whose settings have this can stop in time; all others take as long as they take."""
_AT_LEAST = 0.001  # s; the setting is positive
_FEWEST = 3  # errors that a rate is taken from


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


def error_after(seconds: Sequence[float], errors: Sequence[float], more: float) -> float | None:
    """Return the error after more time, if it goes on falling as in the latter half: exponentially, by least squares.

    Args:
        seconds, errors: Error against run time, in its order; what is not finite does not count.
        more: Time after the last of them [s].

    Returns:
        In the unit of the errors; None where it did not fall, or where there are too few to tell.
    """
    times, values = np.asarray(seconds, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    known = np.isfinite(values) & (values > 0.0)
    times, values = times[known], values[known]
    if len(times) == 0:
        return None
    latter = times >= 0.5 * (times[0] + times[-1])
    if latter.sum() < _FEWEST:
        return None
    rate = float(np.polyfit(times[latter] - times[-1], np.log(values[latter]), 1)[0])
    return float(values[-1] * np.exp(rate * more)) if rate < 0.0 else None
