"""What got better or worse between two results files."""

from __future__ import annotations

import json
from collections.abc import Mapping

import pytest

from vto_pipeline.bench import sample_runs
from vto_pipeline.bench.bench import Row
from vto_pipeline.bench.report_card.changes import compare_folders, compare_results
from vto_pipeline.bench.sample_runs import SAMPLES, run_sample
from vto_pipeline.bench.timing import Timing
from vto_pipeline.errors import ConfigError, InputError

MACHINE = {"cpu": "a processor", "cores": 2, "threads": 1, "memory_gb": 25.3, "load_at_start": 0.1}


def document(*rows: Row, **machine: object) -> dict:
    return {"bench": "toy", "machine": MACHINE | machine, "rows": [row.as_json() for row in rows]}


def row(errors: Mapping, seconds: float = 1.0, spread: float | None = 0.1, **more) -> Row:
    return Row("hang 32", "newton", {"substeps": 1}, 9, seconds, errors, spread_s=spread, **more)


def verdict(name: str, old: object, new: object) -> str:
    changes = compare_results(document(row({name: old})), document(row({name: new}))).changes
    return changes[0].verdict if changes else ""


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("distance_mm", 1.0, 0.9, "better"),
        ("distance_mm", 1.0, 1.2, "worse"),
        ("distance_mm", 1.0, 1.009, ""),
        ("distance_mm", 0.0, 0.1, "worse"),
        ("distance_mm", 1.0, "nan", "worse"),
        ("distance_mm", "nan", "nan", ""),
        ("distance_mm", "inf", 1.0, "better"),
        ("root_error", 1e-16, 9e-16, ""),  # rounding
        ("chest_girth_bias_mm", -8.0, 4.0, "better"),
        ("body_crossings", 0, 1, "worse"),
        ("to_truth_mm.p95", 0.6, 0.7, "worse"),
        ("to_truth_mm.within_2mm", 0.9, 0.99, "better"),
        ("pairs_per_s", 100.0, 50.0, "worse"),
        ("breaks_at", 2.0, "inf", "better"),
        ("settled", True, False, "worse"),
        ("verdict", "refused", "passes", "better"),
        ("status", "too slow", "diverged", "other"),
        ("recovery_frames", 58, None, "other"),
        ("hem_mm", 481.0, 470.0, "other"),  # a size of the garment, not an error
        ("waist_girth_mm", 1065.0, 1000.0, "other"),
        ("mean_height_m", 0.5, 0.4, "other"),
    ],
)
def test_which_way_is_better(name, old, new, expected):
    assert verdict(name, old, new) == expected


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ((1.0, 0.10), (1.25, 0.10), ["worse"]),  # the repeats lie 0.95 to 1.05, and 1.2 to 1.3 at most
        ((1.25, 0.10), (1.0, 0.10), ["better"]),
        ((1.0, 0.20), (1.25, 0.10), []),  # 0.3 s of spread
        ((1.0, 0.0), (1.04, 0.0), []),
        ((1.0, 0.0), (1.06, 0.0), ["worse"]),
        ((1.0, None), (9.0, 0.0), []),  # one run tells nothing of the noise
    ],
)
def test_a_time_counts_where_the_repeats_lie_apart(old, new, expected):
    found = compare_results(document(row({}, *old)), document(row({}, *new)))
    assert [change.verdict for change in found.changes] == expected
    assert found.times == (old[1] is not None)


@pytest.mark.parametrize(
    ("machine", "reason"),
    [
        ({"cpu": "another"}, "other hardware"),
        ({"threads": 2}, "other hardware"),
        ({"load_at_start": 3.0}, "other work ran beside the new one"),
    ],
)
def test_times_of_another_or_a_busy_machine_are_not_compared_and_errors_are(machine, reason):
    old, new = row({"rms_mm": 1.0}, 1.0, threads=1), row({"rms_mm": 2.0}, 9.0, threads=machine.get("threads", 1))
    found = compare_results(document(old), document(new, **machine))
    assert [(change.figure, change.verdict) for change in found.changes] == [("rms_mm", "worse")]
    assert (found.times, found.untimed) == (0, reason)


def test_rows_that_came_and_went_are_told():
    old = [Row("hang 32", "xpbd", {}, 9, 1.0, {}), row({})]
    new = [row({}), Row("hang 64", "newton", {}, 9, 1.0, {}), Row("hang 128", "newton", {}, 9, 1.0, {})]
    found = compare_results(document(*old), document(*new))
    assert (found.gone, found.added) == (("hang 32, xpbd",), 2)


def test_a_row_without_a_spread_is_of_an_earlier_version_and_is_read():
    plain = row({}).as_json()
    del plain["spread_s"]
    assert Row.from_json(plain).spread_s is None


def test_the_spread_is_from_the_shortest_to_the_longest_run():
    assert Timing.of([3.0, 1.0, 1.5], 7.0) == Timing(1.5, 3, 7.0, 2.0)
    assert Timing.of([3.0]).spread_s is None


def test_folders_are_compared_by_name(tmp_path):
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "toy.json").write_text(json.dumps(document(row({"rms_mm": len(name)}))))
    (tmp_path / "new" / "other.json").write_text("{}")
    assert [one.bench for one in compare_folders(tmp_path / "old", tmp_path / "new")] == ["toy"]
    with pytest.raises(InputError, match="no results of other"):
        compare_folders(tmp_path / "old", tmp_path / "new", ("other",))
    with pytest.raises(InputError, match="no results file"):
        compare_folders(tmp_path, tmp_path / "new")


def test_a_sample_document_is_run_where_it_stands_and_measured(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "demo.yaml").write_text("schema: 1\n")
    ran = {}
    monkeypatch.setattr(sample_runs, "run_order", lambda order, **options: ran.update(options, folder=order.folder))
    figures = {"garment": {"to_truth_mm": {"median": 0.2}}, "stages": {"sfm": 2.0, "drape": 3.0}}
    monkeypatch.setattr(sample_runs, "measure_demo", lambda run, samples: figures if run == ran["folder"] else {})
    found = run_sample("demo", tmp_path / "results")
    assert json.loads((tmp_path / "results" / "demo.json").read_text()) == found
    assert (found["command"], ran["base"], ran["cache"]) == ("vto bench demo", tmp_path / "configs", None)
    rows = {plain["method"]: plain for plain in found["rows"]}
    assert rows["garment"]["errors"] == {"to_truth_mm.median": 0.2}
    assert rows["all stages"]["seconds"] == 5.0
    run_sample("demo", tmp_path / "results", force=True)
    assert ran["cache"] is not None
    with pytest.raises(ConfigError, match="no such file"):
        run_sample(SAMPLES[1], tmp_path)
