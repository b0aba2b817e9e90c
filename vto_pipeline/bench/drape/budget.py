"""Error against run time: ten garments on bodies at several target errors; the reference at a hundredth.

With friction there are many states of rest, and which is reached depends on the way. So the truth is the one that the
same run reaches when it goes on: what a drape does does not depend on when it is asked to stop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, partial

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.drape.case import DrapeCase, findings
from vto_pipeline.bench.measures import distance_mm
from vto_pipeline.bench.timing import Timing, timed
from vto_pipeline.model.cloth import Draped

TARGETS_MM = (8.0, 4.0, 2.0, 1.0, 0.5)
"""Errors asked for; the last is what a drape asks for by itself."""

FINER = 100.0
"""The reference is asked for the least of them, divided by this."""

HONEST = 1.5
"""An error may be larger than predicted by this factor."""

Settings = Mapping[str, Value]

_EDGE_MM = 25.0
_PATIENCE = 20.0  # a run that takes longer is not repeated [s]
_CASES = (
    ("shirt", "slim", "silk_charmeuse"),
    ("shirt", "average", "denim"),
    ("shirt", "large", "jersey"),
    ("dress", "slim", "jersey"),
    ("dress", "average", "silk_charmeuse"),
    ("dress", "large", "leather"),
    ("skirt", "slim", "leather"),
    ("skirt", "average", "denim"),
    ("trousers", "average", "jersey"),
    ("trousers", "large", "denim"),
)


def budget_rows(quick: bool, watch: Watch) -> Iterator[Row]:
    """Each case at each target; first its reference."""
    targets = (TARGETS_MM[1], TARGETS_MM[-1]) if quick else TARGETS_MM
    longest: dict[str, Value] = {"settle_seconds": 1.5 if quick else 60.0}
    for names in _CASES[:1] if quick else _CASES:
        case = DrapeCase(*names, edge_mm=40.0 if quick else _EDGE_MM)
        vertices, edges = len(case.made().mesh.vertices), {"edge_mm": case.edge_mm}
        exact = {"target_error_mm": min(targets) / FINER, **longest}
        yield watch.row(case.name, "reference", {**exact, **edges}, vertices, partial(_exact, case, exact))
        for target in targets:
            chosen = {"target_error_mm": target, **longest}
            yield watch.row(case.name, "drape", {**chosen, **edges}, vertices, partial(_measure, case, chosen, exact))


def _measure(case: DrapeCase, settings: Settings, exact: Settings) -> Measured:
    """Return the time to a target, the distance to the reference, and how much larger that is than was predicted."""
    truth = _reference(case, tuple(exact.items()))[0]
    found, timing = timed(partial(case.drape, settings), budget=_PATIENCE)
    shown = findings(found)
    distance = distance_mm(found.mesh.vertices, truth.mesh.vertices)
    predicted = shown["predicted_mm"]
    assert isinstance(predicted, float)
    ratio = distance / predicted if predicted > 0.0 else float("inf")
    known = findings(truth)
    honest = ratio <= HONEST if known["settled"] else None  # what has not come to rest is no judge
    judged = {"distance_mm": distance, "true_over_predicted": ratio, "honest": honest}
    return timing, {**judged, "reference_mm": known["predicted_mm"], **shown}


def _exact(case: DrapeCase, exact: Settings) -> Measured:
    found, timing = _reference(case, tuple(exact.items()))
    return timing, findings(found)


@cache
def _reference(case: DrapeCase, exact: tuple[tuple[str, Value], ...]) -> tuple[Draped, Timing]:
    return timed(partial(case.drape, dict(exact)), runs=1)
