"""What a time budget made too poor: it is made again, finer."""

from __future__ import annotations

import pytest
from toy_levels import chosen

from vto_pipeline.errors import ComputationError


def test_a_level_that_fails_is_done_by_default(machine):
    machine.broken = {("scan", 250)}
    record = machine(40.0)
    assert machine.ran["scan"].pixels == 1000
    scan = record["stages"][0]
    assert scan["level"] == {}
    assert "what would have saved time did not do: too few pixels" in scan["warnings"]
    machine.broken = {("scan", 1000)}
    with pytest.raises(ComputationError, match="too few pixels"):
        machine(300.0, run_name="other")


def test_what_was_made_too_poor_for_a_later_stage_is_made_finer_and_told(machine):
    """Its next level does; the stage that failed on it succeeds, and the page tells why all took longer."""
    machine.too_poor = {250}
    record = machine(40.0)
    assert chosen(machine) == (500, 10)  # the mesh by default, as that was tried before the scan was blamed
    scan, mesh = record["stages"][:2]
    assert scan["level"]["settings"] == {"pixels": 500}
    reason = "done again finer, as mesh failed: nothing to see with 250 pixels"
    assert reason in scan["warnings"]
    assert reason in [text for _, text in machine.told]
    assert [stage["status"] for stage in record["stages"]] == ["ran"] * 4
    assert mesh["reason"] == ""
    assert record["time_spent_s"] > 40.0
    assert not (machine.folder / "run" / "out" / "partial").exists()  # it did not fail in the end
    again = machine(40.0)
    assert set(machine.ran) == {"page"}  # what was made for the same budget is found as it ended
    assert again["stages"][0]["level"] == scan["level"]


def test_what_is_still_too_poor_is_made_by_default(machine):
    machine.too_poor = {250, 500}
    record = machine(40.0)
    assert machine.ran["scan"].pixels == 1000
    assert record["stages"][0]["level"] == {}
    assert "done again by default, as mesh failed: nothing to see with 500 pixels" in record["stages"][0]["warnings"]


def test_what_several_stages_made_too_poor_is_made_by_default_the_second_time(machine):
    machine.picky = True
    record = machine(40.0)
    assert chosen(machine) == (1000, 10)
    assert machine.failures == 2  # on 250 pixels and 20 mm, then on 500 and 20
    assert record["stages"][2]["status"] == "ran"


def test_a_failure_that_more_time_does_not_mend_ends_the_run_after_three_attempts(machine):
    machine.too_poor = {250, 500, 1000}
    with pytest.raises(ComputationError, match="nothing to see with 1000 pixels"):
        machine(40.0)
    assert (machine.folder / "run" / "out" / "partial" / "meshed.txt").exists()
    assert machine.failures == 2 + 1 + 1  # at its own level, and by default on each scan
    machine.failures = 0
    with pytest.raises(ComputationError, match="nothing to see with 1000 pixels"):
        machine(300.0, run_name="calm")
    assert machine.failures == 1
