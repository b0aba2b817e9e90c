"""The sample documents of configs/, run as they stand and held against the truth: rows of a results file each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from vto_pipeline.bench.bench import ALL, Row, Value
from vto_pipeline.bench.demo import measure_demo
from vto_pipeline.bench.machine import this_machine
from vto_pipeline.bench.provenance import provenance
from vto_pipeline.bench.report_card.fronts import fronts
from vto_pipeline.bench.sources import contents_of, sources_of
from vto_pipeline.io.documents import load_yaml, write_json
from vto_pipeline.pipeline.execution.listener import Listener
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.stages.entry.commands import run_order
from vto_pipeline.stages.entry.documents import Order
from vto_pipeline.stages.entry.planning import catalogue

_STAGES = "stages"
_DRIVEN = ("vto_pipeline.bench.demo", "vto_pipeline.pipeline.execution.run")

SAMPLES = (
    *("demo", "garment_from_depth", "garment_from_cloud"),
    *("body_from_measurements", "body_from_silhouettes", "body_from_cloud", "body_from_depth"),
)
"""Names of documents in configs/, whose truth is in sample_data/."""
TRADE = "one run with every default; what else a stage can do is measured in its bench"


def run_sample(
    name: str, folder: Path, *, force: bool = False, say: Callable[[str], None] = lambda text: None
) -> dict[str, Any]:
    """Run a sample document in runs/NAME, as far as that is not done yet, and write what its error is.

    Args:
        name: One of SAMPLES; the working directory is the project's.
        folder: Where NAME.json is written.
        force: Take nothing from earlier runs.
        say: Takes one line of progress.

    Returns:
        A document like those of `record.run_bench`. Its rows have the run's name as scene; their methods are
        "garment", "draped" and so on, "stage NAME" for the seconds of each stage, and "all stages".
    """
    document = Path("configs") / f"{name}.yaml"
    order = Order(load_yaml(document), Path("runs") / name)
    with TemporaryDirectory() as empty:
        cache = Path(empty) if force else None
        run_order(order, base=document.resolve().parent, listener=_Teller(name, say), cache=cache)
    found = measure_demo(order.folder, Path("sample_data"))
    rows = [row.as_json() for row in _rows(name, found)]
    head = {"bench": name, "quick": False, **provenance(f"vto bench {name}")}
    written = {**head, "machine": this_machine(), "sources": _sources(found[_STAGES], document), "rows": rows}
    written["fronts"] = fronts(__name__, (), False)
    write_json(folder / f"{name}.json", written)
    return written


def _sources(stages: Collection[str], document: Path) -> dict[str, str]:
    """Return the contents of all that a sample's figures depend on: of its stages but the page, and of its data."""
    modules = [one.run.__module__ for one in catalogue().stages if one.name in stages and not one.final]
    data = [document, *(path for path in Path("sample_data").rglob("*") if path.is_file())]
    return {**sources_of([*_DRIVEN, *modules]), **contents_of(data, Path())}


class _Teller(Listener):
    """Says which stage a run is at."""

    def __init__(self, name: str, say: Callable[[str], None]) -> None:
        self._name, self._say = name, say

    def started(self, number: int, count: int, stage: Stage) -> None:
        self._say(f"{self._name} [{number}/{count}] {stage.name}")


def _rows(name: str, found: Mapping[str, Any]) -> Iterator[Row]:
    for part, figures in found.items():
        if part != _STAGES:
            errors = dict(_flat(figures))
            yield Row(name, part, {}, int(errors.pop("vertices", 0) or 0), 0.0, errors)
    stages = found[_STAGES]
    yield from (Row(name, f"stage {stage}", {}, 0, seconds, {}) for stage, seconds in stages.items())
    yield Row(name, ALL, {}, 0, sum(stages.values()), {"stages": len(stages)})


def _flat(figures: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Value]]:
    """Yield "to_truth_mm.median" and so on: names of nested figures joined by dots."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value
