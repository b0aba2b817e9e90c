"""What leaving out what a drape does not need saves, and what difference it makes: the same drapes with all of it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.drape.case import Case, findings
from vto_pipeline.bench.timing import timed
from vto_pipeline.model.cloth import Draped
from vto_pipeline.model.job import Job

_PATIENCE = 20.0  # a run that takes longer is not repeated [s]
_CASES = (
    ("shirt", "average", "jersey"),
    ("dress", "average", "silk_charmeuse"),
    ("skirt", "slim", "leather"),
    ("skirt", "average", "denim"),
    ("trousers", "large", "denim"),
)


def left_out_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Five garments on bodies."""
    for names in _CASES[3:4] if quick else _CASES:
        case = Case(*names, edge_mm=40.0 if quick else 25.0)
        settings = {"edge_mm": case.edge_mm}
        yield watch.row(
            f"left out: {case.name}", "default", settings, len(case.made().mesh.vertices), partial(_measure, case)
        )


def _measure(case: Case) -> Measured:
    """Return the time without what is not needed, the share of the whole that this saves, and the difference."""

    (less, job), timing = timed(partial(_run, case, False), budget=_PATIENCE)
    (whole, _), of_whole = timed(partial(_run, case, True), budget=_PATIENCE)
    apart = np.linalg.norm(less.mesh.vertices - whole.mesh.vertices, axis=1)
    return timing, {
        "saved_share": 1.0 - timing.seconds / of_whole.seconds,
        "whole_s": of_whole.seconds,
        "difference_mm": float(1e3 * apart.max()),
        "left_out": "; ".join(what for what, _ in job.left_out),
        **findings(less),
    }


def _run(case: Case, force_all: bool) -> tuple[Draped, Job]:
    job = Job(force_all=force_all)
    return case.drape({}, job=job), job
