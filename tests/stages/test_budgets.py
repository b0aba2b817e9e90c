"""--time-budget, --target-error and --memory, as far as the stages of the project can keep them."""

from __future__ import annotations

import json
import math
import statistics
import time
from contextlib import suppress
from pathlib import Path

import click
import pytest

from vto_pipeline.cli import results
from vto_pipeline.cli.options import Quantity
from vto_pipeline.cli.results import outcome_lines
from vto_pipeline.cli.session import Session
from vto_pipeline.errors import ConfigError
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.levels import shares_as_stated
from vto_pipeline.stages.entry import commands
from vto_pipeline.stages.entry.documents import drape_order, fit_order, scan_order
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.planning import catalogue
from vto_pipeline.stages.levels import LEVELS, USUAL
from vto_pipeline.units import LENGTH_M, MEMORY_B, TIME_S

SAMPLES = Path(__file__).parents[2] / "sample_data"
SHIRT, FORM = SAMPLES / "shirt_on_form" / "shirt.ply", SAMPLES / "shirt_on_form" / "form.ply"
TAPE = SAMPLES / "customer" / "measurements.yaml"


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """What the engine is asked for by an order with budgets."""

    def asked(order, **budgets) -> tuple:
        seen = []

        def run_plan(request, plan, tables, folder, **options):
            seen.append((request.settings["drape"], options["time_budget"]))
            return {}

        monkeypatch.setattr(commands, "run_plan", run_plan)
        commands.run_order(order, tmp_path / "run", **budgets)
        return seen[0]

    return asked


@pytest.mark.parametrize("garments", [1, 2])
def test_the_drape_keeps_both(asked, garments):
    order = drape_order([SHIRT, FORM][:garments], ["denim"], None, TAPE, FORM, False, "a test")
    whole = TimeBudget(90.0)
    settings, time_budget = asked(order, time_budget=whole, target_error=0.002)
    assert (settings.time_budget_s, settings.target_error_mm, time_budget) == (None, 2.0, whole)
    settings, time_budget = asked(order)
    assert (settings.time_budget_s, settings.target_error_mm, time_budget) == (None, 0.5, None)


@pytest.mark.parametrize(
    ("budgets", "refused"),
    [({"time_budget": TimeBudget(90.0)}, "no stage of this run works"), ({"target_error": 0.002}, "no drape")],
)
def test_a_run_that_cannot_adapt_promises_nothing(asked, budgets, refused):
    with pytest.raises(ConfigError, match=refused):
        asked(fit_order(None, TAPE, None, None, None, None, "a test"), **budgets)


def test_a_scan_takes_a_budget_without_a_drape(asked):
    order = scan_order(SAMPLES / "shirt_on_form" / "photos", "garment", FORM, (), None, "a test")
    whole = TimeBudget(90.0)
    assert asked(order, time_budget=whole)[1] == whole


def test_every_level_is_a_valid_setting_and_each_coarser_one_saves_time_for_error():
    stages = {stage.section: stage for stage in catalogue().stages}
    assert LEVELS.keys() <= stages.keys()
    assert USUAL.keys() <= stages.keys()
    for section, levels in LEVELS.items():
        assert section in USUAL
        before = (1.0, 1.0)
        for level in levels:
            stages[section].settings.model_validate(level.settings)
            assert level.seconds.keys() <= stages.keys()
            time_share = math.prod(level.seconds.values())
            assert time_share < before[0]
            assert level.error > before[1]
            before = (time_share, level.error)


def test_what_a_level_states_takes_as_long_as_the_level_where_it_is_one_number():
    stages = {stage.section: stage for stage in catalogue().stages}
    told = set()
    for section, levels in LEVELS.items():
        for level in levels:
            shares = shares_as_stated(levels[: levels.index(level) + 1], stages[section].settings(**level.settings))
            assert shares in ({}, pytest.approx(level.seconds, rel=1e-9))
            told |= {section} if shares else set()
        assert shares_as_stated(levels, stages[section].settings()) == {}
    assert told == {"simulation_mesh"}


def test_usual_times_are_to_each_other_as_those_of_the_results():
    """Within a half of what the last measured run of the demo took, where that is long; its machine may be slower."""
    rows = json.loads((SAMPLES.parent / "docs" / "results" / "demo.json").read_text())["rows"]
    files = {"photos": 37.0}
    pairs = {}
    for row in rows:
        if row["method"].startswith("stage ") and row["seconds"] > 1.0:
            section = row["method"].removeprefix("stage ").rpartition(".")[2]
            pairs[section] = (row["seconds"], USUAL[section].of(files))
    assert len(pairs) > 10
    slower = statistics.median(measured / usual for measured, usual in pairs.values())
    assert 0.3 < slower < 3.0
    for section, (measured, usual) in pairs.items():
        assert slower * usual == pytest.approx(measured, rel=0.5), section


@pytest.mark.parametrize(
    ("text", "units", "value"),
    [
        ("60s", TIME_S, 60.0),
        ("1.5 min", TIME_S, 90.0),
        ("1mm", LENGTH_M, 0.001),
        (".5cm", LENGTH_M, 0.005),
        ("8GB", MEMORY_B, 8e9),
    ],
)
def test_a_quantity_has_a_unit(text, units, value):
    assert Quantity(units).convert(text, None, None) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["60", "60 mm", "0s", "-5s", "nan s", "1e3s", "s", ""])
def test_what_is_no_quantity_is_refused(text):
    with pytest.raises(click.BadParameter, match="one of the units s, min, h"):
        Quantity(TIME_S).convert(text, None, None)


def test_the_outcome_says_what_the_budget_bought():
    """The words are those of `report.budgets`, and its own test."""
    stages = [{"name": "drape", "status": "ran", "seconds": 31.5, "metrics": {}, "warnings": []}]
    record = {"seconds": 55.0, "time_spent_s": 58.0, "time_budget_s": 60.0, "stages": stages}
    record |= {"wanted": ["draped"], "given": {}}
    said = list(outcome_lines(Outcome(Path("nowhere"), record, catalogue())))
    assert "  time budget: 58.0 of 60 s used; drape 31.5 s" in said


def test_the_time_that_loading_the_program_takes_counts(monkeypatch):
    """Against a clock of the test's own, from before the command is read."""
    seen = []
    monkeypatch.setattr(results, "run_order", lambda order, **options: seen.append(options["time_budget"]))
    monkeypatch.setattr(Session, "answer", lambda *_: None)
    monkeypatch.setattr(Session, "enter", lambda *_, **__: None)
    before = time.perf_counter()
    session = Session()
    time.sleep(0.2)  # as imports take
    with suppress(AttributeError):  # there is no outcome to show
        results.perform(session, drape_order([SHIRT], ["denim"], None, TAPE, FORM, False, "a test"), time_budget=9.0)
    (whole,) = seen
    assert whole.seconds == 9.0
    assert before <= whole.began <= time.perf_counter() - 0.2
