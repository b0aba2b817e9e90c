"""A time budget shared out over stages with levels, on a clock that only the stages move, on machines of any pace."""

from __future__ import annotations

import itertools
import json
import time
from dataclasses import replace

import pytest
from pydantic import Field
from toy_tables import read_number, write_number

from vto_pipeline.errors import ComputationError
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution import budget, key
from vto_pipeline.pipeline.execution.budget import TimeBudget
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.run import run
from vto_pipeline.pipeline.levels import DEFAULT, Level, UsualTime
from vto_pipeline.pipeline.plan import make_plan
from vto_pipeline.pipeline.request import read_request
from vto_pipeline.pipeline.stage import Stage

SCAN = (
    Level({"pixels": 500}, {"scan": 0.5, "mesh": 0.8}, 1.5),
    Level({"pixels": 250}, {"scan": 0.2, "mesh": 0.6}, 2.5),
)
MESH = (Level({"edge": 20}, {"mesh": 0.7, "drape": 0.4}, 1.4),)
DRAPE = (Level({}, {"drape": 0.6}, 1.3), Level({}, {"drape": 0.3}, 4.0))
USUAL = {"scan": 60.0, "mesh": 10.0, "drape": 40.0, "page": 2.0}
"""What stages take by default, on the machine that all was measured on [s]."""


class ScanConfig(Config):
    """Settings of a toy scan."""

    pixels: int = Field(1000, ge=1, description="of a photo")
    other: int = Field(0, description="something else")


class MeshConfig(Config):
    """Settings of a toy mesh."""

    edge: int = Field(10, ge=1, description="of a triangle")


class DrapeConfig(Config):
    """Settings of a toy drape."""

    time_budget_s: float | None = Field(None, gt=0, description="wall time [s]")


class Machine:
    """Runs the toy document on a clock of its own.

    `pace` is how many times as long everything takes as was measured; `probed` how many times the
    probe tells, if that is something else; `slow` how much slower single stages are besides;
    `ran` the stages that really ran, with settings; `too_poor` the pixels that a mesh fails on;
    `told` what was said before a stage had ended, with when.
    """

    def __init__(self, folder, monkeypatch) -> None:
        self.folder, self.pace, self.ran, self.broken, self.now = folder, 1.0, {}, set(), 100.0
        self.probed: float | None = None
        self.too_poor: set[int] = set()
        self.slow: dict[str, float] = {}
        self.failures = 0
        self.told: list[tuple[float, str]] = []
        monkeypatch.setattr(time, "perf_counter", lambda: self.now)
        monkeypatch.setattr(budget, "machine_pace", lambda: self.probed or self.pace)
        monkeypatch.setattr(budget, "UNSURE", 1.0)
        (folder / "start.txt").write_text("3")
        names = ("start", "seen", "meshed", "hung")
        kinds = [ArtifactKind(name, f"{name}.txt", name, read_number, write_number) for name in names]
        page = ArtifactKind("page", "page.json", "a page", lambda path: path.read_text(), write_number)
        stages = (
            self.stage("scan", ("start",), "seen", ScanConfig, SCAN),
            self.stage("mesh", ("seen",), "meshed", MeshConfig, MESH),
            self.stage("drape", ("meshed",), "hung", DrapeConfig, DRAPE),
            replace(self.stage("page", (), "page", Config, ()), final=True, optional=("hung",)),
        )
        self.tables = Catalogue(stages, (*kinds, page), {"start": "start"})

    def stage(self, name, needs, made, settings, levels) -> Stage:
        def work(inputs, chosen, job):
            if name == "mesh" and (pixels := self.ran["scan"].pixels) in self.too_poor:
                self.now, self.failures = self.now + 1.0, self.failures + 1
                raise ComputationError(f"nothing to see with {pixels} pixels", partial={"meshed": 0})
            if (name, getattr(chosen, "pixels", None)) in self.broken:
                self.now += 1.0
                raise ComputationError("too few pixels")
            self.ran[name] = chosen
            takes = self.takes(name)
            given = getattr(chosen, "time_budget_s", None) or takes
            self.now += min(takes, given)
            return {made: json.dumps(inputs["run_record"]) if name == "page" else sum(inputs.values()) + 1}

        return Stage(name, name, needs, (made,), work, settings, levels=levels, usual=UsualTime(USUAL[name]))

    def takes(self, name) -> float:
        """By the settings that stages before it, and it, were run with."""
        taken = USUAL[name] * self.pace * self.slow.get(name, 1.0)
        for stage, levels in (("scan", SCAN), ("mesh", MESH)):
            for level in levels:
                (name_of, value), *_ = level.settings.items()
                if stage in self.ran and getattr(self.ran[stage], name_of) == value:
                    taken *= level.seconds.get(name, 1.0)
        return taken

    def __call__(self, seconds=None, overrides=(), run_name="run"):
        document = self.folder / "toy.yaml"
        document.write_text("schema: 1\ngiven: {start: start.txt}\nwant: [hung, page]\n")
        request = read_request(load_yaml(document), self.folder, self.tables, overrides)
        self.ran.clear()
        whole = None if seconds is None else TimeBudget(seconds, self.now)
        self.told.clear()
        listener = Listener()
        listener.warned = lambda text: self.told.append((self.now, text))
        plan, folder = make_plan(request, self.tables), self.folder / run_name
        return run(request, plan, self.tables, folder, time_budget=whole, listener=listener)


@pytest.fixture
def machine(tmp_path, monkeypatch) -> Machine:
    return Machine(tmp_path, monkeypatch)


def least(pace: float) -> float:
    """Time of the quickest way through [s], of all combinations."""
    return min(time_and_error(levels, pace)[0] for levels in every())


def every():
    return itertools.product((DEFAULT, *SCAN), (DEFAULT, *MESH), (DEFAULT, *DRAPE))


def time_and_error(levels, pace: float = 1.0) -> tuple[float, float]:
    total, error = 0.0, 1.0
    for name, taken in USUAL.items():
        for level in levels:
            taken *= level.seconds.get(name, 1.0)
        total += pace * taken
    for level in levels:
        error *= level.error
    return total, error


def chosen(machine) -> tuple[int, int]:
    return machine.ran["scan"].pixels, machine.ran["mesh"].edge


def best(seconds: float, pace: float = 1.0) -> tuple[int, int]:
    """Of all combinations, tried one by one, that of the least error that fits with what is kept back."""
    tried = [(*time_and_error(levels, pace), levels) for levels in every()]
    _, _, (scan, mesh, _) = min((one for one in tried if one[0] <= 0.96 * seconds), key=lambda one: (one[1], one[0]))
    return scan.settings.get("pixels", 1000), mesh.settings.get("edge", 10)


def error_of(record) -> float:
    """Product of what the record says of each stage."""
    found = 1.0
    for stage in record["stages"]:
        found *= stage["level"].get("error", 1.0)
    return found


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
    machine(110.0, run_name="known")
    assert machine.ran["drape"].time_budget_s == pytest.approx(110.0 - USUAL["scan"] - USUAL["mesh"] - USUAL["page"])
