"""--time-budget, --target-error and --memory, as far as the stages of the project can keep them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import click
import pytest

from vto_pipeline.cli.options import Quantity
from vto_pipeline.cli.results import outcome_lines
from vto_pipeline.errors import ConfigError
from vto_pipeline.io.runs.traces import write_trace
from vto_pipeline.model.cloth import TraceRow
from vto_pipeline.stages.entry import commands
from vto_pipeline.stages.entry.documents import drape_order, fit_order
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.planning import catalogue
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
    settings, time_budget = asked(order, time_budget=90.0, target_error=0.002)
    assert (settings.time_budget_s, settings.target_error_mm, time_budget) == (90.0, 2.0, 90.0)
    settings, time_budget = asked(order)
    assert (settings.time_budget_s, time_budget) == (None, None)


@pytest.mark.parametrize("budgets", [{"time_budget": 90.0}, {"target_error": 0.002}])
def test_a_run_without_a_drape_promises_nothing(asked, budgets):
    with pytest.raises(ConfigError, match="no drape in this run"):
        asked(fit_order(None, TAPE, None, None, None, None, "a test"), **budgets)


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
    stages = [
        {"name": "garment.sfm", "status": "ran", "seconds": 20.0, "metrics": {}, "warnings": []},
        {"name": "drape", "status": "ran", "seconds": 31.5, "metrics": {"error_mm": 0.8123}, "warnings": []},
        {"name": "garment.fuse", "status": "cached", "seconds": 50.0, "metrics": {}, "warnings": []},
    ]
    record = {"seconds": 55.0, "wanted": ["draped"], "time_budget_s": 60.0, "stages": stages}
    said = list(outcome_lines(Outcome(Path("nowhere"), record, catalogue())))
    expected = "  of the time budget of 60 s: drape 31.5 s (0.81 mm of motion left), garment.sfm 20.0 s"
    assert expected in said
    assert not any(
        "budget" in line
        for line in outcome_lines(Outcome(Path("nowhere"), {**record, "time_budget_s": None}, catalogue()))
    )


def test_the_outcome_says_what_another_minute_would_buy(tmp_path):
    rows = [TraceRow(float(t), t, 5.0, 1.0, level=1) for t in range(60)]  # of a coarser mesh
    rows += [TraceRow(60.0 + t, t, 8.0 * math.exp(-max(0, t - 15) / 15.0), 1.0) for t in range(31)]
    (tmp_path / "out").mkdir()
    write_trace(tmp_path / "out" / "trace.csv", rows)

    def said(**metrics: object) -> list[str]:
        stage = {"name": "drape", "status": "ran", "seconds": 30.0, "metrics": metrics, "warnings": []}
        record = {"seconds": 30.0, "wanted": ["draped"], "time_budget_s": 30.0, "stages": [stage]}
        return [line for line in outcome_lines(Outcome(tmp_path, record, catalogue())) if "another minute" in line]

    reached = 8.0 * math.exp(-1.0)
    assert said(error_mm=reached, settled=False) == ["  another minute for drape: about 0.054 mm instead of 2.9"]
    assert said(error_mm=0.01, settled=True) == []
    write_trace(tmp_path / "out" / "trace.csv", [replace(row, error_mm=5.0 + row.seconds) for row in rows])
    assert said(error_mm=35.0, settled=False) == [
        "  another minute for drape: not known, as its error did not fall lately"
    ]
