"""The time budget of a run: what other stages leave is what the one that can stop in time gets."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest
from pydantic import Field
from toy_tables import GIVEN, KINDS, TOY, AddConfig

from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution import budget
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.plan import make_plan

DOCUMENT = "schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared, page]\n"
BEFORE, AFTER, PAGE = 3.0, 5.0, 2.0  # s that left.double, square and the page take
STARTING = 0.5  # s before the engine begins: loading the program


class AnytimeConfig(AddConfig):
    """Of a sum that can stop in time."""

    time_budget_s: float | None = Field(None, gt=0, description="wall time [s]")


@pytest.fixture
def budgeted(ask, tmp_path, monkeypatch):
    """Run the document with a budget: the record, and what the stage add was told, or nothing if it was stored.

    On a clock that only three stages move.
    """
    told: list[float | None] = []
    now = 100.0
    monkeypatch.setattr(time, "perf_counter", lambda: now)
    monkeypatch.setattr(budget, "machine_pace", lambda: 1.0)

    def taking(stage, seconds):
        def slow(inputs, settings, job):
            nonlocal now
            now += seconds
            return stage.run(inputs, settings, job)

        return replace(stage, run=slow)

    def add(inputs, settings, job):
        told.append(settings.time_budget_s)
        return {"total": sum(inputs.values()) + settings.offset}

    slow = {"left.double": BEFORE, "square": AFTER, "page": PAGE}
    stages = [taking(stage, slow[stage.name]) if stage.name in slow else stage for stage in TOY.stages]
    stages = [replace(stage, run=add, settings=AnytimeConfig) if stage.name == "add" else stage for stage in stages]
    tables = Catalogue(tuple(stages), KINDS, GIVEN)
    monkeypatch.setitem(ask.__globals__, "TOY", tables)

    def budgeted(seconds: float | None, offset: int = 0) -> tuple[dict, list[float | None]]:
        told.clear()
        overrides = [f"add.offset={offset}"]
        whole = TimeBudget(seconds, time.perf_counter() - STARTING) if seconds else None
        request = ask(DOCUMENT, overrides)
        return run(request, make_plan(request, tables), tables, tmp_path / "run", time_budget=whole), list(told)

    return budgeted


def test_the_stage_gets_what_is_not_spent_and_not_needed_later(budgeted):
    record, (first,) = budgeted(10.0)
    assert first == 10.0 - STARTING - BEFORE  # what comes later was never measured
    assert record["time_budget_s"] == 10.0
    assert record["time_spent_s"] == STARTING + BEFORE + AFTER + PAGE
    add = next(stage for stage in record["stages"] if stage["name"] == "add")
    assert add["metrics"]["time_budget_s"] == first
    _, (second,) = budgeted(20.0)  # left.double is stored; square and the page took as long as they do
    assert second == pytest.approx(20.0 - STARTING - AFTER - PAGE, rel=1e-12)  # by way of its logarithm


def test_the_same_budget_finds_the_same_result_and_another_does_not(budgeted):
    budgeted(10.0)
    assert budgeted(10.0)[1] == []
    assert len(budgeted(11.0)[1]) == 1
    assert budgeted(None)[1] == [None]


def test_a_budget_that_is_spent_is_a_warning(budgeted):
    record, (left,) = budgeted(BEFORE / 2)
    assert 0.0 < left < 0.01
    add = next(stage for stage in record["stages"] if stage["name"] == "add")
    assert add["warnings"][-1] == "nothing is left for it of the time budget of 1.5 s"
