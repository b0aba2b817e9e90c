"""Work left out in drapes: time saved, and difference of the results."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.drape.case import DrapeCase, findings
from vto_pipeline.bench.measures import saved
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.job import Job

_CASES = (
    ("shirt", "average", "jersey"),
    ("dress", "average", "silk_charmeuse"),
    ("skirt", "slim", "leather"),
    ("skirt", "average", "denim"),
    ("trousers", "large", "denim"),
)


def drape_left_out_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Five garments on bodies."""
    for names in _CASES[3:4] if quick else _CASES:
        case = DrapeCase(*names, edge_mm=40.0 if quick else 25.0)
        settings = {"edge_mm": case.edge_mm}
        yield watch.row(
            f"left out: {case.name}", "default", settings, len(case.made().mesh.vertices), partial(_measure, case)
        )


def _measure(case: DrapeCase) -> Measured:
    """Return the time without what is not needed, the share of the whole that this saves, and the difference."""
    (less, job), timing, found = saved(partial(_run, case), lambda ended: ended[0].mesh.vertices)
    return timing, {
        **found,
        "left_out": "; ".join(what for what, _ in job.left_out),
        **findings(less),
    }


def _run(case: DrapeCase, force_all: bool) -> tuple[Draped, Job]:
    job = Job(force_all=force_all)
    return case.drape({}, job=job), job
