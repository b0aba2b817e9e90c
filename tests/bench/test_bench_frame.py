"""The frame of the benches: what is kept, what is measured again, what a timing is."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from datetime import date, datetime, timezone
from pathlib import Path
from types import SimpleNamespace

import pytest

from vto_pipeline.bench import BENCHES
from vto_pipeline.bench import record as record_module
from vto_pipeline.bench.bench import Bench, Row, Watch
from vto_pipeline.bench.machine import same_machine, this_machine
from vto_pipeline.bench.record import Files, run_bench
from vto_pipeline.bench.report_card.fronts import Trade
from vto_pipeline.bench.timing import Timing, timed

ROOT = Path(__file__).parents[2]
NAMES = ("solvers", "integrators", "stability", "physics", "collision", "drape", "body", "peers", "scaling")


class Counted:
    """A bench of four points that counts how often it measures, and can be interrupted before one of them."""

    def __init__(self, interrupted_before: int | None = None) -> None:
        self.measured: list[int] = []
        self.interrupted_before = interrupted_before

    def rows(self, quick: bool, watch: Watch) -> Iterator[Row]:
        for k in range(2 if quick else 4):
            yield watch.row("hang", "toy", {"substeps": k}, 9, lambda k=k: self._measure(k))

    def _measure(self, k: int) -> tuple[Timing, dict]:
        if k == self.interrupted_before:
            raise KeyboardInterrupt
        self.measured.append(k)
        return Timing(1.0 + k, 3, 0.5, 0.25), {"rms_mm": 10.0**-k, "worst_mm": float("inf")}


@pytest.fixture
def bench_of(monkeypatch):
    def make(counted: Counted) -> Bench:
        bench = Bench("a toy", "toy", lambda document: str(len(document["rows"])).encode())
        monkeypatch.setattr(Bench, "rows", lambda self, quick, watch: counted.rows(quick, watch))
        trade = Trade(("rms_mm",), lambda quick: lambda row: row.settings["substeps"] == 2)
        monkeypatch.setitem(sys.modules, "toy", SimpleNamespace(TRADE=trade))
        return bench

    return make


def run(bench_of, folder, counted, **options):
    return run_bench("toy", bench_of(counted), folder, **options)


def test_document_and_picture(bench_of, tmp_path):
    document = run(bench_of, tmp_path, Counted())
    files = Files.of("toy", tmp_path)
    assert json.loads(files.document.read_text()) == document
    assert files.picture.read_bytes() == b"4"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["toy.json", "toy.png"]
    assert document["bench"] == "toy"
    assert document["command"] == "vto bench toy"
    (front,) = document["fronts"]
    assert front["front"] == [f"toy, substeps {k}" for k in range(4)]
    assert (front["default"], front["verdict"]) == ("toy, substeps 2", "on the front")
    assert date.fromisoformat(document["date"]) <= datetime.now(timezone.utc).date()
    head = ""  # where there is no git
    if shutil.which("git") is not None:
        head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    assert head[:12] == (document["commit"] or "").removesuffix("+changes")
    assert document["rows"][2] == {
        "scene": "hang",
        "method": "toy",
        "settings": {"substeps": 2},
        "vertices": 9,
        "seconds": 3.0,
        "errors": {"rms_mm": 0.01, "worst_mm": "inf"},
        "runs": 3,
        "compile_s": 0.5,
        "threads": document["machine"]["threads"],
        "spread_s": 0.25,
    }


def test_an_interrupted_bench_goes_on_where_it_stopped(bench_of, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run(bench_of, tmp_path, Counted(interrupted_before=2))
    files = Files.of("toy", tmp_path)
    assert not files.document.exists()
    assert len(files.journal.read_text().splitlines()) == 1 + 2  # the machine, and what was measured
    with files.journal.open("a") as journal:
        journal.write('{"scene": "ha')  # killed while it wrote
    after = Counted()
    document = run(bench_of, tmp_path, after)
    assert after.measured == [2, 3]
    assert [row["settings"]["substeps"] for row in document["rows"]] == [0, 1, 2, 3]


def test_an_interrupted_bench_leaves_the_last_whole_document(bench_of, tmp_path, monkeypatch):
    whole = run(bench_of, tmp_path, Counted())
    with pytest.raises(KeyboardInterrupt):
        run(bench_of, tmp_path, Counted(interrupted_before=1), force=True)
    assert json.loads(Files.of("toy", tmp_path).document.read_text()) == whole


def test_known_rows_are_not_measured_again(bench_of, tmp_path):
    run(bench_of, tmp_path, Counted(), quick=True)
    more, forced = Counted(), Counted()
    run(bench_of, tmp_path, more)
    assert more.measured == [2, 3]
    run(bench_of, tmp_path, forced, force=True)
    assert forced.measured == [0, 1, 2, 3]


@pytest.mark.parametrize("changed", ["cpu", "threads", "numba"])
def test_rows_of_another_machine_do_not_count(bench_of, tmp_path, monkeypatch, changed):
    run(bench_of, tmp_path, Counted())
    other = {**this_machine(), changed: "other"}
    monkeypatch.setattr(record_module, "this_machine", lambda: other)
    again = Counted()
    run(bench_of, tmp_path, again)
    assert again.measured == [0, 1, 2, 3]


def test_rows_count_as_long_as_the_files_that_the_bench_drives_are_the_same(bench_of, tmp_path, monkeypatch):
    sources = {"solver.py": "1"}
    monkeypatch.setattr(record_module, "sources_of", lambda modules: dict(sources))
    with pytest.raises(KeyboardInterrupt):
        run(bench_of, tmp_path, Counted(interrupted_before=2))
    after = Counted()
    assert run(bench_of, tmp_path, after)["sources"] == sources
    assert after.measured == [2, 3]  # what the journal has counts
    monkeypatch.setattr(record_module, "this_machine", lambda: {**this_machine(), "code": "of a page, say"})
    same = Counted()
    run(bench_of, tmp_path, same)
    assert same.measured == []
    sources["solver.py"] = "2"
    other = Counted()
    run(bench_of, tmp_path, other)
    assert other.measured == [0, 1, 2, 3]


def test_load_is_a_state_and_not_the_machine():
    here = this_machine()
    assert here["cores"] >= here["threads"] >= 1
    assert same_machine(here, {**here, "load_at_start": 99.0, "niceness": 19})
    assert not same_machine(here, {**here, "python": "3.99"})


def test_key_is_what_was_chosen():
    row = Row("hang", "xpbd", {"a": 1, "b": 2.0}, 9, 1.0, {})
    assert row.key == Row("hang", "xpbd", {"b": 2.0, "a": 1}, 9, 5.0, {"rms_mm": 3.0}).key
    others = [Row("sphere", "xpbd", row.settings, 9, 1.0, {}), Row("hang", "xpbd", {"a": 2, "b": 2.0}, 9, 1.0, {})]
    assert row.key not in [other.key for other in others]
    assert Row.from_json(row.as_json()) == row


def test_median_of_three_after_a_warm_run(monkeypatch):
    ticks = iter([0.0, 7.0, 10.0, 15.0, 20.0, 21.0, 30.0, 32.0])  # warm 7 s, then 5, 1 and 2 s
    monkeypatch.setattr("vto_pipeline.bench.timing.time.perf_counter", lambda: next(ticks))
    called: list[str] = []
    result, timing = timed(lambda: called.append("run") or len(called), warm=lambda: called.append("warm"))
    assert called == ["warm", "run", "run", "run"]
    assert (result, timing) == (4, Timing(2.0, 3, 7.0, 4.0))


def test_a_run_over_the_budget_is_not_repeated(monkeypatch):
    ticks = iter([0.0, 5.0])
    monkeypatch.setattr("vto_pipeline.bench.timing.time.perf_counter", lambda: next(ticks))
    assert timed(lambda: None, budget=4.0)[1] == Timing(5.0, 1)


def test_the_table_has_the_promised_names():
    assert tuple(BENCHES) == NAMES
