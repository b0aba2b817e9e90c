"""The wall time of a run, and what of it each stage gets; and the memory of a run."""

from __future__ import annotations

import math
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from vto_pipeline.errors import ConfigError
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.execution.cost_model import FILES, CostModel, Figures, step_figures
from vto_pipeline.pipeline.execution.forecast import forecast
from vto_pipeline.pipeline.execution.pace import machine_pace
from vto_pipeline.pipeline.execution.sharing import Shares, factor, share_out
from vto_pipeline.pipeline.execution.store import Store
from vto_pipeline.pipeline.levels import DEFAULT, Level, shares_as_stated
from vto_pipeline.pipeline.plan import Plan, Step
from vto_pipeline.pipeline.request import Request

SETTING = "time_budget_s"
"""A stage whose settings have this can stop in time; others can run at another level, or take as long as they take."""
_AT_LEAST = 0.001  # s; the setting is positive
_SURE = 2.0  # s of stages after which their pace counts as much as what was forecast
UNSURE = 1.25
"""What the table of stages says is taken so many times: other captures take longer than the sample."""
_KEPT_BACK = 0.04  # of what is left, for what forecasts miss
_MORE = 60.0  # s, of which it is said what they would buy
_STOPPED = 0.95  # of what a stage may take; one that took that had to stop


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
    """A time budget, shared out over the stages of one run, anew whenever one of them is about to run.

    What a stage takes by default is known from earlier runs of this build on this machine. Else the table of stages
    says it, with how slow this machine is; where it does not, runs of other builds do. What this run's stages took
    against that corrects it.

    Args:
        whole: Of the run.
        request: What is given.
        plan: Its stages. Settings that are stated stay as they are.
        store: Tells what stages take, by the cost model.
        finals: Stage -> time [s] of final stages when this build last ran them in this folder; the store has none of
            them.
        stored: Stages whose results by default are there.
    """

    def __init__(
        self,
        whole: TimeBudget,
        request: Request,
        plan: Plan,
        store: Store,
        finals: Mapping[str, float],
        stored: Collection[str],
    ) -> None:
        self.whole, self._plan = whole, plan
        self._usual = _usual_times(request, plan, CostModel(store), finals)
        self._loading = whole.spent
        self._usual |= dict.fromkeys(stored, 0.0)
        self._open = [step.stage.name for step in plan.steps if step.stage.name not in stored]
        offers = {step.stage.section: (DEFAULT, *_allowed(step)) for step in plan.steps}
        open_sections = {name.rpartition(".")[2] for name in self._open}
        self._offers = {name: levels for name, levels in offers.items() if name in open_sections and len(levels) > 1}
        self._chosen: dict[str, Level] = {}
        self._given: dict[str, float] = {}
        self._took = self._forecast = 0.0
        self._warned = self._refined = False

    def adapts(self, step: Step) -> bool:
        """Return whether what a stage does depends on the budget."""
        return can_stop(step) or step.stage.section in self._offers

    def level(self, step: Step) -> Level:
        """Return the level that a stage is to be run at; from now on it stands for all stages of its section."""
        section = step.stage.section
        if section in self._offers and section not in self._chosen and not can_stop(step):
            self._chosen[section] = self._offers[section][self._shares().levels[section]]
        return self._chosen.get(section, DEFAULT)

    def by_default(self, step: Step) -> None:
        """Take note that a stage has to be run by default after all."""
        self._chosen[step.stage.section] = DEFAULT

    def finer(self, names: Collection[str]) -> dict[str, str]:
        """Take back what a budget made of stages, as it is too poor for a later one.

        At first the one whose level adds most to the error gets the next level. The second time all are run by default.

        Args:
            names: Stages that the later one depends on.

        Returns:
            Those to be done again, each with what is done, in words; none where all ran by default.
        """
        sections = {name.rpartition(".")[2] for name in names}
        coarse = {one: level for one, level in self._chosen.items() if one in sections and level.settings}
        if coarse and not self._refined:
            worst = max(coarse, key=lambda one: coarse[one].error)
            less = [level for level in self._offers[worst] if level.error < coarse[worst].error]
            coarse = {worst: max(less, key=lambda level: level.error)}
        else:
            coarse = dict.fromkeys(coarse, DEFAULT)
        self._chosen |= coarse
        self._refined = True
        again = {name: coarse[section] for name in names if (section := name.rpartition(".")[2]) in coarse}
        return {name: "done again " + ("finer" if level.settings else "by default") for name, level in again.items()}

    def share(self, step: Step, job: Job) -> Config:
        """Return a stage's settings, with what is left as its own budget if it can stop in time.

        It gets the least of its levels, though that be more than what is left: stopped before, it is of no use.
        """
        if not can_stop(step):
            return step.settings
        left, stated = self.left_for(step), getattr(step.settings, SETTING)
        least = min((one.seconds[step.stage.section] for one in step.stage.levels if not one.settings), default=0.0)
        least *= self._times().get(step.stage.name, 0.0)
        given = self._given[step.stage.name] = min(max(left, least, _AT_LEAST), stated or math.inf)
        job.measure(time_budget_s=round(left, 1))
        if left <= 0.0:
            job.warn(f"nothing is left for it of the time budget of {self.whole.seconds:g} s")
        return step.settings.model_copy(update={SETTING: given})

    def left_for(self, step: Step) -> float:
        """Return what is left for a stage [s]: neither spent, nor needed by those after it; maybe less than none."""
        later = {one.stage.name for one in self._plan.steps[self._plan.steps.index(step) + 1 :]}
        return self.whole.seconds - self.whole.spent - sum(t for name, t in self._times().items() if name in later)

    def found(self, name: str, level: Mapping[str, Any], seconds: float) -> None:
        """Take note of a stage whose result was stored: its level as recorded, and what it took then [s]."""
        if name not in self._open:
            return
        section = name.rpartition(".")[2]
        for one in self._offers.get(section, ()):
            if level and dict(one.settings) == level["settings"]:
                self._chosen.setdefault(section, one)
        self._ended(name, seconds / self._factor(name))

    def ran(self, step: Step, seconds: float) -> float:
        """Take note of a stage that has run, and return that time as a share of what it takes by default.

        Args:
            step: The stage.
            seconds: What it took [s].
        """
        name, share = step.stage.name, self._factor(step.stage.name)
        by_default = seconds / share
        if seconds >= _STOPPED * self._given.get(name, math.inf):  # it would have taken longer; how long is not known
            by_default = max(by_default, self._usual[name] * self._pace)
            if name.rpartition(".")[2] in self._offers:
                self._chosen[step.stage.section] = _stopped_at(self._offers[step.stage.section], seconds / by_default)
        elif self._usual[name] > 0.0:
            self._took, self._forecast = self._took + seconds, self._forecast + self._usual[name] * share
        self._ended(name, by_default)
        return max(seconds, _AT_LEAST) / max(by_default, _AT_LEAST)

    def shortage(self) -> str:
        """Return in words that the budget cannot be kept, and how much is needed at least; once, else nothing."""
        least = self.whole.spent + share_out(self._times(), self._open_offers(), 0.0).seconds
        if least > self.whole.seconds and not self._warned:
            self._warned = True
            return f"the time budget of {self.whole.seconds:g} s is too short: this run needs about {least:.0f} s"
        return ""

    def summary(self) -> dict[str, Any]:
        """Return what run.json says of the whole: the least that it takes, and what another minute would buy.

        Both are of a run that begins anew. The error is a multiple of this run's.
        """
        least = share_out(self._usual, self._offers, 0.0)
        more = (self.whole.seconds + _MORE) * (1.0 - _KEPT_BACK) - self._loading
        bought = share_out(self._usual, self._offers, more)
        now = math.prod(level.error for level in self._chosen.values())
        changed = {
            section: dict(self._offers[section][number].settings)
            for section, number in bought.levels.items()
            if self._offers[section][number] is not self._chosen.get(section, DEFAULT)
        }
        return {
            "time_least_s": round(least.seconds + self._loading, 1),
            "another_minute": {"levels": changed if bought.error < now else {}, "error": min(1.0, bought.error / now)},
        }

    @property
    def _pace(self) -> float:
        return (_SURE + self._took) / (_SURE + self._forecast)

    def _factor(self, name: str) -> float:
        return factor(list(self._chosen.values()), name.rpartition(".")[2])

    def _times(self) -> dict[str, float]:
        """Stage -> what it will take [s], of those that have not run, at the levels chosen so far."""
        return {name: self._usual[name] * self._pace * self._factor(name) for name in self._open}

    def _open_offers(self) -> dict[str, tuple[Level, ...]]:
        return {section: levels for section, levels in self._offers.items() if section not in self._chosen}

    def _shares(self) -> Shares:
        left = (self.whole.seconds - self.whole.spent) * (1.0 - _KEPT_BACK)
        return share_out(self._times(), self._open_offers(), left)

    def _ended(self, name: str, by_default: float) -> None:
        self._usual[name] = by_default
        self._open = [one for one in self._open if one != name]
        section = name.rpartition(".")[2]
        if not any(one.rpartition(".")[2] == section for one in self._open):
            self._chosen.setdefault(section, DEFAULT)


def can_stop(step: Step) -> bool:
    """Return whether a stage can stop in time."""
    return SETTING in type(step.settings).model_fields


def _allowed(step: Step) -> list[Level]:
    """Return the levels that change no setting that is stated."""
    return [one for one in step.stage.levels if not step.settings.model_fields_set & one.settings.keys()]


def _usual_times(request: Request, plan: Plan, model: CostModel, finals: Mapping[str, float]) -> dict[str, float]:
    """Return stage -> what it takes by default [s]; 0 where nothing is known."""
    found, pace = dict[str, float](), machine_pace()
    stages = {step.stage.name: step.stage for step in plan.steps}
    stated = [shares_as_stated(step.stage.levels, step.settings) for step in plan.steps]
    for name, figures in step_figures(request, plan).items():
        usual, section = stages[name].usual, stages[name].section
        if usual is not None and not model.timed_here(name):
            share = math.prod(shares.get(section, 1.0) for shares in stated)
            found[name] = UNSURE * pace * share * usual.of(_files(figures))
        else:
            found[name] = model.seconds(name, figures) or 0.0
    return {**found, **finals}


def _files(figures: Figures) -> dict[str, float]:
    """Return how many files of each kind a stage's work is made from, such as "photos"; of several roles, the most."""
    found: dict[str, float] = {}
    for name, value in figures.items():
        if name.endswith(FILES) and not isinstance(value, str):
            kind = name.removesuffix(FILES).rpartition(".")[2]
            found[kind] = max(found.get(kind, 0.0), math.expm1(value))
    return found


def _stopped_at(levels: Sequence[Level], share: float) -> Level:
    """Return the level of a stage that had to stop: of those it was offered, the one that takes about as long."""
    return min(levels, key=lambda level: abs(math.prod(level.seconds.values()) - share))


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
