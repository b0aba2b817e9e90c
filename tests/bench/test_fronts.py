"""Fronts of error against run time: against brute force, and the results files against their own rows."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.bench import BENCHES, sample_runs
from vto_pipeline.bench.bench import Row, Watch
from vto_pipeline.bench.cloth import solvers
from vto_pipeline.bench.drape import budget
from vto_pipeline.bench.report_card import fronts as module
from vto_pipeline.bench.report_card.fronts import NEAR, Trade, distances, fronts
from vto_pipeline.bench.sample_runs import SAMPLES
from vto_pipeline.bench.scaling import gpu
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.drape_config import DrapeConfig

RESULTS = sorted((Path(__file__).parents[2] / "docs" / "results").glob("[!f]*.json"))  # first_run is no bench


def row(method: str, seconds: float, error: object, scene: str = "hang", **settings) -> Row:
    return Row(scene, method, settings, 9, seconds, {"error": error})


def of(rows: list[Row], monkeypatch, trade: Trade | None = None):
    trade = trade or Trade(("error",), lambda quick: lambda one: one.method == "ours")
    monkeypatch.setattr(module, "import_module", lambda name: type("Bench", (), {"TRADE": trade}))
    return fronts("a bench", rows, False)


def nothing_beats(point: np.ndarray, others: np.ndarray) -> bool:
    """By the definition of dominance, tie by tie."""
    return not any((o <= point).all() and (o < point).any() for o in others)


@pytest.mark.parametrize("seed", range(20))
def test_the_front_is_what_nothing_beats(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    points = np.round(rng.uniform(0.5, 3.0, (12, 2)), 1)  # so coarse that there are ties
    rows = [row("ours" if k == 0 else f"other {k}", *map(float, point)) for k, point in enumerate(points)]
    (entry,) = of(rows, monkeypatch)
    front = [r.method for r, point in zip(rows, points, strict=True) if nothing_beats(point, points)]
    assert sorted(entry["front"]) == sorted(front)
    assert (entry["verdict"] == "on the front") <= ("ours" in front)


@pytest.mark.parametrize("seed", range(20))
def test_either_distance_is_what_takes_the_point_to_the_best_of_the_same_time_or_error(seed):
    """By trying: the other axis is slackened, then this one shrunk until all that is left is no better."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(0.5, 3.0, (12, 2))
    tried = np.linspace(1.0, 7.0, 60001)

    def shrunk(axis: int) -> float:
        same = points[points[:, 1 - axis] <= NEAR * points[0, 1 - axis], axis]
        return next(factor for factor in tried if (points[0, axis] / factor <= same).all())

    found = distances(*points[0], points)
    assert found[1] == pytest.approx(shrunk(0), abs=2e-4)  # the step of the search
    assert found[0] == pytest.approx(shrunk(1), abs=2e-4)


def said(monkeypatch, seconds: float, error: float, *others: tuple[float, float]) -> str:
    rows = [row(f"other {k}", *point) for k, point in enumerate(others)]
    return of([row("ours", seconds, error), *rows], monkeypatch)[0]["verdict"]


def test_the_verdict_looks_at_the_error_in_its_time_and_at_the_time_at_its_error(monkeypatch):
    assert said(monkeypatch, 0.5, 2.0, (1.0, 1.0)) == "on the front"
    assert said(monkeypatch, 1.05, 1.04, (1.0, 1.0)) == "within 10 % of the front"
    assert said(monkeypatch, 1.0, 1.5, (1.0, 1.0)) == "1.5 times the least error in its time"
    assert said(monkeypatch, 4.0, 1.0, (1.0, 1.0)) == "4 times the least time at its error"
    both = "3 times the least error in its time, 2 times the least time at its error"
    assert said(monkeypatch, 2.0, 3.0, (1.0, 3.0), (1.0, 1.0)) == both
    assert NEAR == 1.1


@pytest.mark.parametrize("last_digit", [-0.01, 0.0, 0.01])
def test_where_the_error_has_stopped_to_fall_more_time_is_told(last_digit, monkeypatch):
    """Which of the two beats the other is chance; that one takes four times the time is not."""
    found = said(monkeypatch, 4.0, 1.0, (1.0, 1.0 + last_digit), (0.5, 2.0))
    assert found == "4 times the least time at its error"


def test_a_default_that_was_not_measured_is_told(monkeypatch):
    entry = of([row("ours", 1.0, "nan"), row("other", 1.0, 1.0), row("third", 2.0, 0.5)], monkeypatch)[0]
    assert entry["verdict"] == "the default was not measured"
    assert entry["default"] is entry["error_factor"] is entry["time_factor"] is None
    assert entry["front"] == ["other", "third"]


def test_points_have_the_same_names_whatever_the_order_of_their_settings(monkeypatch):
    one, other = (
        [row("ours", 1.0, 2.0, **made), row("theirs", 2.0, 1.0)] for made in ({"b": 1, "a": 2.5}, {"a": 2.5, "b": 1})
    )
    assert of(one, monkeypatch) == of(other, monkeypatch)
    assert of(one, monkeypatch)[0]["default"] == "ours, a 2.5, b 1"


def test_truth_failures_and_other_scenes_do_not_count(monkeypatch):
    rows = [row("ours", 1.0, 1.0), row("other", 2.0, 2.0), row("reference", 0.1, 0.0), row("failed", 0.0, 0.0)]
    (entry,) = of([*rows, row("alone", 0.1, 0.1, "sphere")], monkeypatch)
    assert (entry["scene"], entry["front"]) == ("hang", ["ours"])
    trade = Trade(("error",), lambda quick: lambda one: True, scene=("stiffness",))
    rows = [row("a", 1.0, 1.0, stiffness=s, steps=n) for s in (10.0, 20.0) for n in (1, 2)]
    found = of(rows, monkeypatch, trade)
    assert [one["scene"] for one in found] == ["hang, stiffness 10", "hang, stiffness 20"]
    assert found[0]["default"] == "a, steps 1"


def test_an_error_below_the_truths_own_is_as_good_as_that_one(monkeypatch):
    """On a ball, long steps leave the cloth higher, and less stretched than it is in truth: that is no lesser error."""
    long, usual = row("ours", 6.8, 3.49e-4, steps=0.25), row("ours", 11.6, 4.32e-4, steps=1.0)
    trade = Trade(("error",), lambda quick: lambda one: one.settings["steps"] == 1.0)
    (bare,) = of([long, usual], monkeypatch, trade)
    assert bare["error_factor"] == pytest.approx(4.32 / 3.49, abs=1e-3)
    (known,) = of([long, usual, row("reference", 40.0, 4.03e-4, steps=4.0)], monkeypatch, trade)
    assert known["error_factor"] == pytest.approx(4.32 / 4.03, abs=1e-3)
    assert known["verdict"] == "1.7 times the least time at its error"  # 7 % more of it
    assert known["front"] == bare["front"] == ["ours, steps 0.25"]


def test_an_error_of_nothing_at_all_leaves_the_time_to_compare(monkeypatch):
    assert distances(3.0, 0.0, [(3.0, 0.0), (1.0, 0.0)]) == (1.0, 3.0)
    assert distances(3.0, 1.0, [(3.0, 1.0), (1.0, 0.0)]) == (inf, 3.0)
    assert distances(1.0, 0.0, [(1.0, 0.0), (3.0, 0.0)]) == (1.0, 1.0)
    entry = of([row("ours", 3.0, 1.0), row("other", 1.0, 0.0)], monkeypatch)[0]
    assert (entry["error_factor"], entry["time_factor"]) == (None, 3.0)  # JSON has no infinity


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_every_results_file_says_where_todays_default_stands(path):
    """Against its own rows, by the benches as they are."""
    document = json.loads(path.read_text())
    name = document["bench"]
    modules = dict.fromkeys(SAMPLES, sample_runs.__name__) | {key: one.module for key, one in BENCHES.items()}
    bench = (modules | {"gpu": gpu.__name__})[name]
    found = fronts(bench, [Row.from_json(one) for one in document["rows"]], document["quick"])
    assert document["fronts"] == found, f"{path.name} does not say so: measure it again"
    assert found, "neither a front nor a reason"


@pytest.mark.parametrize("name", BENCHES)
def test_every_bench_has_a_trade_or_a_reason(name):
    trade = module.import_module(BENCHES[name].module).TRADE
    assert isinstance(trade, Trade) or len(trade.split()) > 5


def test_quick_benches_measure_the_default_however_slow_the_machine(monkeypatch):
    """No scene is run: what would be measured is looked at, and every row takes longer than patience lasts."""
    given = {}

    def measured(case, scene, config, truth):
        given[scene.name, config.solver, config.substeps] = case.most
        return Timing(60.0), {}

    monkeypatch.setattr(solvers, "_measure", measured)
    monkeypatch.setattr(solvers, "_reference", lambda case, scene: (None, (Timing(1.0), {})))
    found = [row for case in [*solvers._cases(True)][:2] for row in solvers._rows_of(case, Watch())]
    is_default = solvers.TRADE.default(True)
    assert {row.scene for row in found if is_default(row)} == {"hang 10", "sphere 10"}
    newton = [row.settings["substeps"] for row in found if row.method == "newton"]
    assert newton == [0.25] * 2  # and nothing beyond it
    assert sorted(set(given.values())) == [0.4, inf]
    assert budget.TARGETS_MM[-1] == DrapeConfig.model_validate({}).target_error_mm
