"""The memory budget of a run: what stages took before, what is left for one that fits itself into it."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_tables import CALLS, GIVEN, KINDS, TOY

from vto_pipeline.errors import ConfigError
from vto_pipeline.model.job import Job
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.plan import make_plan

DOCUMENT = "schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared]\n"
BLOCK = 300e6  # B that the stage add takes besides what the process has
needs_linux = pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="no peak of a stage elsewhere")


@pytest.fixture
def budgeted(ask, tmp_path, monkeypatch):
    """Run the document with a budget of memory; the record, and what the stage add was told."""
    told: list[float] = []

    def add(inputs, settings, job):
        CALLS.append("add")
        told.append(job.memory)
        block = np.ones(int(BLOCK / 8))
        return {"total": sum(inputs.values()) + settings.offset + int(block[0]) - 1}

    def budgeted(memory: float | None, offset: int = 0, fits: bool = False) -> tuple[dict, list[float]]:
        told.clear()
        CALLS.clear()
        stages = [replace(one, run=add, fits_memory=fits) if one.name == "add" else one for one in TOY.stages]
        tables = Catalogue(tuple(stages), KINDS, GIVEN)
        monkeypatch.setitem(ask.__globals__, "TOY", tables)
        request = ask(DOCUMENT, [f"add.offset={offset}"])
        return run(request, make_plan(request, tables), tables, tmp_path / "run", memory=memory), list(told)

    return budgeted


@needs_linux
def test_a_run_of_which_a_stage_took_more_is_refused_before_it_begins(budgeted):
    record, told = budgeted(None)
    assert told == [math.inf]
    assert record["memory_budget_mb"] is None
    peaks = {stage["name"]: stage["peak_mb"] for stage in record["stages"]}
    assert peaks["add"] > peaks["left.double"] + 0.9e-6 * BLOCK
    between = 1e6 * peaks["add"] - 0.5 * BLOCK
    with pytest.raises(ConfigError, match=r"add takes about [\d.]+ GB .*, by earlier runs; the budget is") as caught:
        budgeted(between, offset=1)
    assert "vto plan" in caught.value.hint
    assert CALLS == []
    record, told = budgeted(between)  # all is stored: nothing needs memory
    assert (told, record["memory_budget_mb"]) == ([], between / 1e6)
    assert budgeted(between, offset=2, fits=True)[1] == [between]  # it would see to it itself
    assert budgeted(1e6 * peaks["add"] + BLOCK, offset=3)[1] == [1e6 * peaks["add"] + BLOCK]


def test_of_what_never_ran_nothing_is_known(budgeted):
    record, told = budgeted(1e6)
    assert told == [1e6]
    assert {stage["status"] for stage in record["stages"]} <= {"ran", "left_out"}


@needs_linux
def test_what_is_left_of_a_budget_is_what_is_not_in_use():
    job = Job(memory=4e9)
    before = job.memory_left()
    block = np.ones(int(BLOCK / 8))
    during = job.memory_left()
    assert 0.9 * BLOCK < before - during < 1.2 * BLOCK
    del block
    assert job.memory_left() > during + 0.9 * BLOCK  # given back
    assert before < 4e9


def test_no_budget_is_the_machine():
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert Job().memory_left() == machine
    assert Job(memory=1e18).memory_left() == machine
