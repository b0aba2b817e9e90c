"""Runs on the sample data, compared with the truth, as rows of a results file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from vto_pipeline.bench.bench import Row, Value
from vto_pipeline.bench.machine import this_machine
from vto_pipeline.bench.provenance import provenance

_STAGES = "stages"


def sample_document(run: Path, found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the results file of one run.

    Args:
        run: Its folder, named as its document in configs/ is: runs/demo for configs/demo.yaml.
        found: From `demo.measure_demo`.

    Returns:
        A document like those of `record.run_bench`. Its rows have the run's name as scene; their methods are
        "garment", "draped" and so on, "stage NAME" for the seconds of each stage, and "all stages".
    """
    name = run.resolve().name
    run_it, judge = f"vto run configs/{name}.yaml -o runs/{name}", f"python -m vto_pipeline.bench runs/{name}"
    command = f"{run_it} && {judge} --results docs/results"
    rows = [row.as_json() for row in _rows(name, found)]
    return {"bench": name, "quick": False, **provenance(command), "machine": this_machine(), "rows": rows}


def _rows(name: str, found: Mapping[str, Any]) -> Iterator[Row]:
    for part, figures in found.items():
        if part != _STAGES:
            errors = dict(_flat(figures))
            yield Row(name, part, {}, int(errors.pop("vertices", 0) or 0), 0.0, errors)
    stages = found[_STAGES]
    yield from (Row(name, f"stage {stage}", {}, 0, seconds, {}) for stage, seconds in stages.items())
    yield Row(name, "all stages", {}, 0, sum(stages.values()), {"stages": len(stages)})


def _flat(figures: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Value]]:
    """Yield "to_truth_mm.median" and so on: names of nested figures joined by dots."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value
