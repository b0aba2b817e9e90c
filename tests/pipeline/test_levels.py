"""A time budget shared out over stages with levels, on a clock that only the stages move, on machines of any pace."""

from __future__ import annotations

from dataclasses import replace

import pytest
from toy_levels import USUAL, best, chosen, error_of, least

from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution import budget


@pytest.mark.parametrize("seconds", [38.0, 50.0, 62.0, 75.0, 90.0, 105.0, 120.0, 300.0])
def test_on_the_machine_that_all_was_measured_on_the_best_is_chosen(machine, seconds):
    record = machine(seconds)
    assert record["time_spent_s"] <= seconds + 1e-6
    assert chosen(machine) == best(seconds)


@pytest.mark.parametrize("pace", [0.5, 1.0, 1.7, 3.0])
def test_the_budget_is_kept_at_any_pace_and_more_time_buys_no_more_error(machine, pace):
    machine.pace = pace
    errors = []
    for number, share in enumerate([1.6, 2.0, 2.6, 3.5, 5.0, 9.0]):
        seconds = share * least(pace)
        record = machine(seconds, run_name=f"run{number}")
        assert record["time_spent_s"] <= 1.1 * seconds
        errors.append(error_of(record))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] == 1.0


def test_a_machine_that_turns_out_slow_is_noticed_after_the_first_stage(machine):
    """Another program has begun since the probe."""
    machine.pace, machine.probed = 2.0, 1.0
    record = machine(160.0)
    assert chosen(machine) == (1000, 20)  # at the pace of the probe, all would fit as it is
    assert best(160.0) == (1000, 10)
    assert record["time_spent_s"] <= 160.0 * 1.02


def test_a_capture_that_takes_a_little_longer_than_the_sample_is_in_time(machine, monkeypatch):
    """By so much as is allowed for: else the first stage, chosen as if it took no longer, takes what others need."""
    monkeypatch.setattr(budget, "UNSURE", 1.25)
    machine.pace, machine.probed = 1.25, 1.0
    record = machine(50.0)
    assert machine.ran["scan"].pixels == 250  # with 500 all takes 47 s by the table, and 59 in truth
    assert record["time_spent_s"] <= 50.0 * 1.02


def test_what_this_machine_took_before_is_known(machine):
    machine.pace, machine.probed = 2.0, 1.0
    machine(run_name="known")
    (machine.folder / "start.txt").write_text("4")  # other input: nothing is stored for it
    record = machine(150.0, run_name="known")
    assert chosen(machine) == best(150.0, 2.0) != best(150.0)
    assert record["time_spent_s"] <= 150.0 * 1.02


def test_a_hurried_run_does_not_teach_that_all_is_quick(machine):
    """What stages took at a level is counted as what they take by default."""
    machine(45.0, run_name="known")
    assert chosen(machine) == (250, 20)
    (machine.folder / "start.txt").write_text("4")
    record = machine(62.0, run_name="known")
    assert chosen(machine) == best(62.0) != (1000, 10)
    assert record["time_spent_s"] <= 62.0 * 1.02


def test_a_setting_that_is_stated_stays(machine):
    machine(40.0, overrides=("scan.pixels=900",))
    assert chosen(machine) == (900, 20)
    machine(40.0, overrides=("scan.other=1",), run_name="other")
    assert chosen(machine) == (250, 20)
    assert machine.ran["scan"].other == 1
    machine(300.0, overrides=("drape.time_budget_s=5",), run_name="third")
    assert machine.ran["drape"].time_budget_s == 5.0


def test_a_stated_setting_counts_as_the_levels_tell(machine):
    """With 250 pixels all fits: by default it would not, and that is not said of it."""
    record = machine(45.0, overrides=("scan.pixels=250",))
    assert machine.told == []
    assert chosen(machine) == (250, 20)
    assert record["time_spent_s"] <= 45.0


def test_a_stage_that_stops_in_time_gets_what_its_least_level_takes_though_nothing_is_left(machine):
    record = machine(20.0)  # the quickest levels of all take more
    assert chosen(machine) == (250, 20)
    assert machine.ran["drape"].time_budget_s == pytest.approx(0.3 * 0.4 * USUAL["drape"])
    assert record["time_spent_s"] > 20.0


def test_without_a_budget_levels_change_nothing(machine):
    plain = machine()
    assert chosen(machine) == (1000, 10)
    rows = tuple(replace(stage, levels=(), usual=None) for stage in machine.tables.stages)
    machine.tables = Catalogue(rows, machine.tables.kinds, machine.tables.given)
    bare = machine()
    assert [stage["key"] for stage in bare["stages"]] == [stage["key"] for stage in plain["stages"]]
    assert [stage["status"] for stage in bare["stages"]] == ["cached", "cached", "cached", "ran"]
    assert "another_minute" not in plain


def test_what_is_stored_by_default_is_taken(machine):
    machine()
    record = machine(6.0)
    assert [stage["status"] for stage in record["stages"]] == ["cached", "cached", "cached", "ran"]
    assert all(stage["level"] == {} for stage in record["stages"])
    assert record["time_least_s"] == USUAL["page"]
    assert record["another_minute"]["levels"] == {}


def test_a_plenty_budget_leaves_results_that_a_run_without_one_takes(machine):
    machine(300.0)
    record = machine()
    assert [stage["status"] for stage in record["stages"]] == ["cached", "cached", "ran", "ran"]  # the drape had an end


def test_the_same_budget_finds_the_same_and_another_does_not(machine):
    first = machine(60.0)
    assert set(machine.ran) == {"scan", "mesh", "drape", "page"}
    again = machine(60.0)
    assert set(machine.ran) == {"page"}
    assert [stage["level"] for stage in again["stages"]] == [stage["level"] for stage in first["stages"]]
    machine(61.0)
    assert "scan" in machine.ran


def test_a_budget_that_cannot_be_kept_is_told_with_the_least(machine):
    began = machine.now
    record = machine(15.0)
    told = [text for stage in record["stages"] for text in stage["warnings"] if "too short" in text]
    assert told == [f"the time budget of 15 s is too short: this run needs about {least(1.0):.0f} s"]
    assert record["stages"][0]["warnings"] == told
    assert machine.told == [(began, *told)]  # before anything has run
    assert chosen(machine) == (250, 20)
    assert record["time_least_s"] == pytest.approx(least(1.0), abs=0.1)


def test_what_another_minute_would_buy_is_what_it_buys(machine):
    record = machine(60.0)
    more = machine(120.0, run_name="more")
    assert chosen(machine) == (
        record["another_minute"]["levels"]["scan"].get("pixels", 1000),
        record["another_minute"]["levels"]["mesh"].get("edge", 10),
    )
    assert record["another_minute"]["error"] == pytest.approx(error_of(more) / error_of(record), rel=1e-9)
    assert machine(300.0, run_name="most")["another_minute"] == {"levels": {}, "error": 1.0}
