"""`python -m vto_pipeline.bench.scaling.forecasts FOLDER` holds what the cost model foretells against what runs took.

Each run below the folder is forecast from all the others, stage by stage, as `vto plan` and `vto batch` would have.
What came from the cache, and what is left out, is no work and counts on neither side.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from vto_pipeline.bench.printed_table import print_table
from vto_pipeline.errors import InputError
from vto_pipeline.io.documents import read_json
from vto_pipeline.pipeline.execution.cost_model import Figures, fit_cost
from vto_pipeline.pipeline.execution.folder import RECORD

Taken = dict[str, tuple[Figures, float]]
"""Stage -> figures of its work, and the time that it took [s]."""

_COLUMNS = ("stage", "times", "took s", "foretold", "off (mean)", "off (median)", "within a quarter")
_WHOLE = "whole runs"
_BAR = 0.25


def taken_by_runs(folder: Path) -> list[Taken]:
    """Return what the stages took that ran in each run below a folder; without runs in which none did.

    Raises:
        InputError: there are fewer than two.
    """
    found: list[Taken] = []
    for path in sorted(folder.rglob(RECORD)):
        stages = [one for one in read_json(path)["stages"] if one["status"] == "ran" and not one["reason"]]
        found.append({one["name"]: (one["figures"], float(one["seconds"])) for one in stages})
    found = [one for one in found if one]
    if len(found) < 2:
        raise InputError(f"{len(found)} runs; a forecast of one needs others", where=str(folder))
    return found


def forecasts(runs: Sequence[Taken]) -> dict[str, list[tuple[float, float]]]:
    """Return for each stage, and for whole runs, what each run took and what the others foretell [s].

    Args:
        runs: As `taken_by_runs`. A stage that no other run has is not forecast.
    """
    found = defaultdict[str, list[tuple[float, float]]](list)
    for index, run in enumerate(runs):
        pairs = []
        for stage, (figures, seconds) in run.items():
            others = [other[stage] for k, other in enumerate(runs) if k != index and stage in other]
            if (cost := fit_cost(others)) is not None:
                pairs.append((seconds, cost.expected(figures)))
                found[stage].append(pairs[-1])
        if len(pairs) == len(run):
            found[_WHOLE].append((sum(took for took, _ in pairs), sum(foretold for _, foretold in pairs)))
    return dict(found)


def table(folder: Path) -> Iterator[tuple[str, ...]]:
    """Yield a row for each stage, the one that took longest first, and one for whole runs."""
    found = forecasts(taken_by_runs(folder))
    for stage, pairs in sorted(found.items(), key=lambda one: -sum(took for took, _ in one[1])):
        took, foretold = np.maximum(np.array(pairs), 1e-3).T  # s: what clocks tell apart
        off = np.abs(foretold / took - 1.0)
        yield (
            stage,
            str(len(pairs)),
            f"{took.sum():.0f}",
            f"{foretold.sum() / took.sum():.2f} of it",
            f"{off.mean():.0%}",
            f"{np.median(off):.0%}",
            f"{np.mean(off <= _BAR):.0%}",
        )


def main() -> int:
    """Read the command line, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m vto_pipeline.bench.scaling.forecasts", description=__doc__)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="BATCH/rows, or any folder of runs")
    return print_table(_COLUMNS, table(parser.parse_args().folder))


if __name__ == "__main__":
    sys.exit(main())
