"""A toy table of stages with levels, on a clock that only its stages move."""

from __future__ import annotations

import itertools
import json
import time
from dataclasses import replace

from pydantic import Field
from toy_tables import read_number, write_number

from vto_pipeline.errors import ComputationError
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.model.artifact import ArtifactKind
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.catalogue import Catalogue
from vto_pipeline.pipeline.execution import budget
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
    `ran` the stages that really ran, with settings; `too_poor` the pixels that a mesh fails on,
    `picky` whether a drape fails on anything but scan and mesh by default;
    `told` what was said before a stage had ended, with when.
    """

    def __init__(self, folder, monkeypatch) -> None:
        self.folder, self.pace, self.ran, self.broken, self.now = folder, 1.0, {}, set(), 100.0
        self.probed: float | None = None
        self.too_poor: set[int] = set()
        self.slow: dict[str, float] = {}
        self.failures, self.picky = 0, False
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
            if name == "drape" and self.picky and (self.ran["scan"].pixels, self.ran["mesh"].edge) != (1000, 10):
                self.failures += 1
                raise ComputationError("too coarse to hang")
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
