"""What a run bought with its budgets, in words, and what another minute would buy."""

from __future__ import annotations

import math

import pytest

from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.report.budgets import budget_lines, error_after
from vto_pipeline.report.page import build_page


def stage(name: str, status: str, seconds: float, **metrics: object) -> dict:
    return {
        "name": name,
        "status": status,
        "seconds": seconds,
        "peak_mb": 100.0,
        "metrics": metrics,
        "warnings": [],
        "notes": [],
        "left_out": [],
        "reason": "",
    }


def record(*stages: dict, **more: object) -> dict:
    return {"seconds": 55.0, "time_spent_s": 57.25, "time_budget_s": 60.0, "stages": list(stages), **more}


def test_what_took_longest_comes_first_and_what_was_stored_took_nothing():
    stages = [
        stage("garment.sfm", "ran", 20.0),
        stage("drape", "ran", 31.5, error_mm=0.8123, settled=True),
        stage("garment.fuse", "cached", 50.0),
    ]
    first, second = budget_lines(record(*stages), ())
    assert first == "time budget: 57.2 of 60 s used; drape 31.5 s (0.81 mm of motion left), garment.sfm 20.0 s"
    assert second == "another minute for drape: nothing more, it is at rest"
    assert list(budget_lines(record(*stages, time_budget_s=None), ())) == []
    assert list(budget_lines(record(stages[2]), ())) == ["time budget: 57.2 of 60 s used; everything was stored"]
    unknown = stage("drape", "ran", 31.5, error_mm=None, settled=False)
    first, second = budget_lines(record(unknown), ())
    assert "drape 31.5 s (how much motion is left is unknown)" in first
    assert second.startswith("another minute for drape: not known, as it has not moved for long enough")


def test_the_level_of_a_stage_is_told_with_what_it_costs_and_what_a_minute_more_would_choose():
    level = {"settings": {"max_side_px": 600, "rematch": {"rounds": 2}}, "error": 1.25}
    scanned = {**stage("garment.stereo", "ran", 12.0), "level": level}
    more = {"levels": {"stereo": {}, "sfm": {"features": {"window": 4}}}, "error": 0.8}
    first, second = budget_lines(record(scanned, another_minute=more, time_least_s=40.0), ())
    assert first.endswith("garment.stereo 12.0 s (max_side_px=600, rematch.rounds=2: 1.25 times the usual error)")
    assert second == (
        "another minute for the whole run: stereo as usual; sfm features.window=4; about 0.80 times this error"
    )
    nothing = record(scanned, another_minute={"levels": {}, "error": 1.0}, time_least_s=40.0)
    assert list(budget_lines(nothing, ()))[1] == "another minute for the whole run: nothing more"


def test_a_budget_that_was_not_kept_is_told_with_the_least():
    late = record(stage("garment.sfm", "ran", 70.0), time_spent_s=75.0, time_least_s=71.3)
    assert list(budget_lines(late, ()))[1] == (
        "the time budget was not kept: this run takes 71 s at least, on this machine as loaded"
    )
    assert len(list(budget_lines({**late, "time_spent_s": 65.9}, ()))) == 1


def test_a_run_of_an_earlier_version_has_no_time_spent():
    older = record(stage("drape", "ran", 31.5))
    del older["time_spent_s"]
    assert list(budget_lines(older, ())) == ["time budget: 55.0 of 60 s used; drape 31.5 s"]


def test_another_minute_goes_on_as_the_garments_own_mesh_did():
    rows = [TraceRow(float(t), t, 5.0, 1.0, level=1) for t in range(60)]  # of a coarser mesh
    rows += [TraceRow(60.0 + t, t, 8.0 * math.exp(-max(0, t - 15) / 15.0), 1.0) for t in range(31)]
    reached = 8.0 * math.exp(-1.0)
    draped = record(stage("drape", "ran", 30.0, error_mm=reached, settled=False))
    assert list(budget_lines(draped, rows))[1] == "another minute for drape: about 0.054 mm instead of 2.9"
    rising = [TraceRow(row.seconds, row.step, 5.0 + row.seconds, 1.0) for row in rows]
    assert list(budget_lines(draped, rising))[1] == (
        "another minute for drape: not known, as its error did not fall lately"
    )


def test_the_page_says_it_too():
    draped = record(stage("drape", "ran", 31.5, error_mm=0.8, settled=True))
    page = build_page(draped, {})
    for line in budget_lines(draped, ()):
        assert line in page
    assert "time budget" not in build_page({**draped, "time_budget_s": None}, {})


def test_another_minute_is_told_from_how_the_error_fell():
    seconds = [2.0 * k for k in range(21)]
    falling = [8.0 * math.exp(-t / 50.0) for t in seconds]
    expected = 8.0 * math.exp(-(40.0 + 60.0) / 50.0)
    assert error_after(seconds, falling, 60.0) == pytest.approx(expected, rel=1e-9)  # the closed form itself
    early = [math.inf, 0.5, *falling[2:]]  # the first half does not count, nor what is not known
    assert error_after(seconds, early, 60.0) == pytest.approx(expected, rel=1e-9)
    gap = [math.inf if k == 15 else value for k, value in enumerate(falling)]
    assert error_after(seconds, gap, 60.0) == pytest.approx(expected, rel=1e-9)
    noisy = [value * (1.2 if k % 2 else 1 / 1.2) for k, value in enumerate(falling)]
    assert error_after(seconds, noisy, 60.0) == pytest.approx(expected / 1.2, rel=0.3)
    assert error_after(seconds, falling[::-1], 60.0) is None
    assert error_after(seconds[:3], falling[:3], 60.0) is None
    assert error_after([], [], 60.0) is None
    assert error_after([1.0, 2.0], [math.inf, math.nan], 60.0) is None
