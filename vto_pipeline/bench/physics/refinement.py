"""One scene over finer and finer meshes or steps, with the order of convergence from each to the next."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.timing import Timing, clocked

_EXACT = 1e-9  # an error below this is rounding and has no order


@dataclass(frozen=True)
class RefinementCase:
    """One refinement.

    Args:
        vertices: How large.
        run: Computes the errors; the first of them is the one whose order is taken.
    """

    vertices: int
    run: Callable[[], Mapping[str, float]]


def refined(
    watch: Watch,
    scene: str,
    method: str,
    settings: Mapping[str, Value],
    name: str,
    counts: Sequence[int],
    make: Callable[[int], RefinementCase],
) -> Iterator[Row]:
    """Yield a row for each count, which `settings` gets under this name."""
    before: tuple[int, float] | None = None
    for count in counts:
        case = make(count)
        measure = partial(_measured, case, count, before)
        row = watch.row(scene, method, {**settings, name: count}, case.vertices, measure)
        error = next(iter(row.errors.values()))
        before = (count, error) if isinstance(error, float) else None
        yield row


def _measured(case: RefinementCase, count: int, before: tuple[int, float] | None) -> Measured:
    found, seconds = clocked(case.run)
    errors: dict[str, Value] = dict(found)
    error = next(iter(errors.values()))
    if before is not None and isinstance(error, float) and min(error, before[1]) > _EXACT and math.isfinite(error):
        errors["order"] = math.log(before[1] / error) / math.log(count / before[0])
    return Timing(seconds), errors
