"""`python -m vto_pipeline.bench.scan.levels` measures what each level of a stage saves and costs, on the sample shirt.

Each level runs alone against all defaults; what it leaves unchanged is taken from the store. Times are CPU time, so
that a busy machine counts little. Shares are of the time by default, beside those of `stages.levels` in brackets; in a
folder where the defaults have run before, they are not known.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.bench.bench import Value
from vto_pipeline.bench.demo import distances, measure_demo
from vto_pipeline.bench.live_rows import LiveRows
from vto_pipeline.io.documents import load_yaml
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.execution.record import StageRecord
from vto_pipeline.pipeline.levels import DEFAULT, Level
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.report.budgets import in_words
from vto_pipeline.stages.entry.commands import run_order
from vto_pipeline.stages.entry.documents import Order
from vto_pipeline.stages.levels import LEVELS

_COLUMNS = (
    *("section", "settings", "stage_cpu_s", "shares", "p95_mm", "back_p95_mm", "error", "table_error"),
    *("draped_off_median_mm", "draped_off_p95_mm"),
)
_DOCUMENT = Path("configs/demo.yaml")


class _Clock(Listener):
    """CPU time of each stage that ran [s]."""

    def __init__(self) -> None:
        self.taken: dict[str, float] = {}
        self._began = 0.0

    def started(self, number: int, count: int, stage: Stage) -> None:
        self._began = time.process_time()

    def ended(self, number: int, count: int, record: StageRecord) -> None:
        if record.status == "ran":
            self.taken[record.name] = time.process_time() - self._began


def main() -> None:
    """Read the command line, run, and print a row for each level."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scan.levels", description=__doc__)
    parser.add_argument("--section", action="append", choices=sorted(LEVELS), help="default: all that have settings")
    parser.add_argument("--out", type=Path, default=Path("runs/levels"), metavar="DIR", help="for runs and rows.jsonl")
    arguments = parser.parse_args()
    table = LiveRows(arguments.out, _COLUMNS)
    usual = _run(arguments.out, "default", "", DEFAULT)
    table.add(_row("default", DEFAULT, usual, usual))
    for section in arguments.section or LEVELS:
        for number, level in enumerate(LEVELS[section], start=1):
            if level.settings:
                name = f"{section}{number}"
                row = _row(section, level, _run(arguments.out, name, section, level), usual)
                table.add(row | _draped_off(arguments.out / name, arguments.out / "default"))


def _run(folder: Path, name: str, section: str, level: Level) -> dict[str, Any]:
    """Return CPU seconds by stage, and the garment's distances to the truth."""
    clock, order = _Clock(), Order(load_yaml(_DOCUMENT), folder / name)
    changes = [f"{section}.{key}={json.dumps(value)}" for key, value in level.settings.items()]
    run_order(order, overrides=changes, base=_DOCUMENT.resolve().parent, listener=clock, cache=folder / "cache")
    return {**measure_demo(order.folder, Path("sample_data"))["garment"], "cpu": clock.taken}


def _row(section: str, level: Level, found: Mapping[str, Any], usual: Mapping[str, Any]) -> dict[str, Value]:
    there, back = (found[side]["p95"] for side in ("to_truth_mm", "from_truth_mm"))
    return {
        "section": section,
        "settings": in_words(level.settings),
        "stage_cpu_s": _taken(found["cpu"], section) if level.settings else sum(found["cpu"].values()),
        "shares": shares_in_words(level, found["cpu"], usual["cpu"]),
        "p95_mm": there,
        "back_p95_mm": back,
        "error": max(there / usual["to_truth_mm"]["p95"], back / usual["from_truth_mm"]["p95"]),
        "table_error": level.error,
    }


def shares_in_words(level: Level, cpu: Mapping[str, float], usual: Mapping[str, float]) -> str:
    """Return what stages took at a level as shares of what they take by default, each with that of the table.

    Args:
        level: Of the table.
        cpu, usual: Stage -> CPU time [s] at the level, and by default.
    """
    shares = {one: (_taken(cpu, one), _taken(usual, one), known) for one, known in level.seconds.items()}
    return ", ".join(f"{one} {now / then:.2f} ({known:g})" for one, (now, then, known) in shares.items() if then > 0.0)


def _taken(cpu: Mapping[str, float], section: str) -> float:
    """Return what the stages of a section took [s]."""
    return sum(seconds for name, seconds in cpu.items() if name.rpartition(".")[2] == section)


def _draped_off(run: Path, usual: Path) -> dict[str, Value]:
    """Return how far the drape is from that of the default [mm]."""
    one, other = (read_own_mesh(folder / "out" / "draped.ply") for folder in (run, usual))
    middle, high = 1e3 * np.percentile(distances(one, other), [50, 95])
    return {"draped_off_median_mm": float(middle), "draped_off_p95_mm": float(high)}


if __name__ == "__main__":
    main()
