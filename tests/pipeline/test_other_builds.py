"""What other builds took: it does not mislead a time budget."""

from __future__ import annotations

from dataclasses import replace

import pytest
from toy_levels import USUAL, best, chosen

from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution import key


@pytest.fixture
def other_build(monkeypatch):
    """Call it: all that was timed so far was timed on another build."""
    return lambda: monkeypatch.setattr(key, "code_identity", lambda: "another source")


def test_what_another_build_took_is_set_aside(machine, other_build):
    """It was three times as slow in the scan, ten times in the page, and quick elsewhere; now all is as measured."""
    machine.pace = 0.1
    machine.slow = {"scan": 30.0, "page": 100.0}
    machine(run_name="known")
    machine.pace, machine.slow = 1.0, {}
    other_build()
    record = machine(90.0, run_name="known")
    assert chosen(machine) == best(90.0)
    assert record["time_spent_s"] <= 90.0 * 1.02
    assert machine.ran["drape"].time_budget_s > 0.4 * USUAL["drape"]


def test_what_another_build_took_is_better_than_nothing(machine, other_build):
    """Of a stage that the table does not know."""
    machine.tables = Catalogue(
        tuple(replace(stage, usual=None) if stage.name == "mesh" else stage for stage in machine.tables.stages),
        machine.tables.kinds,
        machine.tables.given,
    )
    machine(run_name="known")
    other_build()
    machine(95.0, run_name="known")
    assert chosen(machine) == best(95.0) == (1000, 20)  # had the mesh taken no time, it could be as fine as usual
