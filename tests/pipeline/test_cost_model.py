"""The forecast of run times: against measured runs left out one by one, and against laws known in closed form."""

from __future__ import annotations

import csv
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from toy_tables import TOY

from vto_pipeline.pipeline.batch import time_left
from vto_pipeline.pipeline.batch.order import Row
from vto_pipeline.pipeline.batch.time_left import TimeLeft
from vto_pipeline.pipeline.execution import key
from vto_pipeline.pipeline.execution.cost_model import TIMED, CostModel, fit_cost
from vto_pipeline.pipeline.execution.forecast import forecast
from vto_pipeline.pipeline.execution.store import MANIFEST, Store
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.stages.entry import planning
from vto_pipeline.stages.entry.batches import plan_rows

COMPILED = 100.0  # s: the first row of the batch took longer, as it compiled its kernels


def measured() -> list[tuple[dict[str, float | str], float]]:
    """Drapes of one batch: four garments of the Berkeley library, three MakeHuman bodies, two meshes, one thread."""
    with (Path(__file__).parent / "measured_drapes.csv").open(newline="") as stream:
        return [
            (
                {
                    "garment.mesh": row["garment"],
                    "garment.mesh bytes": math.log1p(int(row["garment_bytes"])),
                    "body.mesh": row["body"],
                    "simulation_mesh.edge_mm": math.log(int(row["edge_mm"]) / 10),
                },
                float(row["seconds"]),
            )
            for row in csv.DictReader(stream)
        ]


def test_the_forecast_of_a_batch_is_within_a_quarter_of_the_truth() -> None:
    rows = measured()
    assert len(rows) == 24
    truth, forecasts, medians = [], [], []
    for index, (figures, seconds) in enumerate(rows):
        if seconds > COMPILED:
            continue  # forecast by none; it stays among what the others are forecast from
        others = rows[:index] + rows[index + 1 :]
        cost = fit_cost(others)
        assert cost is not None
        truth.append(seconds)
        forecasts.append(cost.expected(figures))
        medians.append(np.median([taken for _, taken in others]))
    assert len(truth) == 23
    assert sum(forecasts) / sum(truth) == pytest.approx(1.0, abs=0.25)
    error = np.abs(np.array(forecasts) / truth - 1)
    assert error.mean() < 0.25
    assert error.mean() < 0.8 * np.abs(np.array(medians) / truth - 1).mean()  # better than knowing nothing of the row


def law(garment: int, body: int, size: float) -> float:
    """Seconds by a law of the model's own form."""
    return 3.0 * (size / 1e4) ** 1.3 * (1.0, 1.5, 0.7)[garment] * (1.0, 2.0)[body]


def test_a_power_law_with_effects_is_found() -> None:
    sizes = (1e4, 3e4, 1e5, 3e5)
    cells = list(itertools.product(range(3), range(2), sizes))
    kept = [cell for i, cell in enumerate(cells) if i % 4 != 1]
    records = [({"garment": f"g{g}", "body": f"b{b}", "bytes": math.log(n)}, law(g, b, n)) for g, b, n in kept]
    cost = fit_cost([*records, (records[0][0], 100 * records[0][1])])  # one that met something else
    assert cost is not None
    for g, b, n in set(cells) - set(kept):
        got = cost.expected({"garment": f"g{g}", "body": f"b{b}", "bytes": math.log(n)})
        assert got == pytest.approx(law(g, b, n), rel=0.15)  # priors draw effects of 0.7 by a tenth to the mean
    assert cost.terms["bytes"] == pytest.approx(1.3, abs=0.1)


def test_other_builds_tell_how_time_grows_and_this_one_how_long_it_takes() -> None:
    sizes = (1e4, 3e4, 1e5, 3e5)
    for slower in (0.2, 5.0):
        records = [({"bytes": math.log(n), TIMED: "other"}, slower * law(0, 0, n)) for n in sizes * 3]
        cost = fit_cost([*records, ({"bytes": math.log(1e4), TIMED: "this"}, law(0, 0, 1e4))])
        assert cost is not None
        for n in sizes:
            got = cost.expected({"bytes": math.log(n), TIMED: "this"})
            assert got == pytest.approx(law(0, 0, n), rel=0.1)  # the power is drawn to 0 by its prior


def test_few_records_give_their_median_and_none_nothing() -> None:
    assert fit_cost([]) is None
    few = fit_cost([({"bytes": 1.0}, 2.0), ({"bytes": 9.0}, 4.0), ({"bytes": 5.0}, 300.0)])
    assert few is not None
    assert few.expected({"bytes": 100.0}) == pytest.approx(4.0)


def take(folder: Path, stage: str, seconds: float) -> None:
    """Let a stage's results have taken that long."""
    for path in (folder / "run/cache" / stage).glob(f"*/{MANIFEST}"):
        manifest = json.loads(path.read_text())
        manifest["record"]["seconds"] = seconds
        path.write_text(json.dumps(manifest))


def test_a_plan_tells_what_its_stages_will_take(ask, go, tmp_path: Path) -> None:
    text = "schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared]\n"
    record = go(text)
    figures = {stage["name"]: stage["figures"] for stage in record["stages"]}
    assert figures["square"]["left.number bytes"] == pytest.approx(math.log1p(1))
    take(tmp_path, "add", 7.0)
    request = ask(text, ["add.offset=3"])
    expected = forecast(request, make_plan(request, TOY), Store(tmp_path / "run/cache"))
    assert expected["left.double"].stored
    assert expected["add"].seconds == pytest.approx(7.0)


def test_of_few_records_only_those_of_this_build_count(go, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared]\n"
    figures = {stage["name"]: stage["figures"] for stage in go(text)["stages"]}["add"]
    take(tmp_path, "add", 70.0)
    store = Store(tmp_path / "run/cache")
    assert CostModel(store).timed_here("add")
    monkeypatch.setattr(key, "code_identity", lambda: "another source")
    other = CostModel(store)
    assert not other.timed_here("add")
    assert other.seconds("add", figures) == pytest.approx(70.0)  # better than nothing
    before = set((store.folder / "add").glob(f"*/{MANIFEST}"))
    go(text)
    (made,) = set((store.folder / "add").glob(f"*/{MANIFEST}")) - before
    manifest = json.loads(made.read_text())
    manifest["record"]["seconds"] = 7.0
    made.write_text(json.dumps(manifest))
    both = CostModel(store)
    assert both.timed_here("add")
    assert both.seconds("add", figures) == pytest.approx(7.0)


def test_what_rows_share_is_counted_once(go, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "catalogue", lambda: TOY)
    go("schema: 1\ngiven: {left: {number: left.txt}}\nwant: [squared]\n")
    for stage, seconds in (("left.double", 50.0), ("add", 7.0), ("square", 1.0)):
        take(tmp_path, stage, seconds)
    (tmp_path / "other.txt").write_text("5")
    source = {"left": {"number": str(tmp_path / "other.txt")}}
    rows = [
        Row(
            f"r{i}",
            {"schema": 1, "given": source, "want": ["squared"], "stages": {"add": {"offset": i}}},
            "here",
            tmp_path,
        )
        for i in (1, 2)
    ]
    first, second = plan_rows(rows, Store(tmp_path / "run/cache"), lambda *_: False, False)
    assert first.seconds == pytest.approx(58.0)
    assert second.seconds == pytest.approx(8.0)  # the doubled number is the same
    assert plan_rows(rows, Store(tmp_path / "nowhere"), lambda *_: False, False)[0].seconds is None
    assert not CostModel(Store(tmp_path / "nowhere"))


def test_the_time_left_follows_the_rows_that_have_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(time_left.time, "monotonic", lambda: now)
    left = TimeLeft({"a": 30.0, "b": 10.0, "c": 20.0, "d": math.inf}, 2)
    assert left.seconds() == pytest.approx((30 + 10 + 20 + 20) / 2)  # d as the median
    now = 130.0
    left.ended("a")
    left.ended("b")
    assert left.seconds() == pytest.approx(30.0)  # half of the forecast took 30 s
    assert TimeLeft({"a": 60.0, "b": 1.0}, 4).seconds() == 60.0  # no sooner than its longest row
    unknown = TimeLeft({"a": math.inf, "b": math.inf}, 1)
    assert unknown.seconds() is None
    now = 140.0
    unknown.ended("a")
    assert unknown.seconds() == pytest.approx(10.0)
