"""Run time against the number of vertices at equal error, speed of the inner kernels, and cost of threads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from vto_pipeline.bench.bench import Measured, Row, Value, Watch
from vto_pipeline.bench.cloth.scenes import hang, measures
from vto_pipeline.bench.cloth.solvers import timed_run
from vto_pipeline.bench.report_card.fronts import Trade
from vto_pipeline.bench.scaling.batches import batch_rows
from vto_pipeline.bench.scaling.direct_solvers import direct_rows
from vto_pipeline.bench.scaling.overhead import overhead_rows
from vto_pipeline.bench.scaling.throughput import kernel_rows
from vto_pipeline.bench.timing import Timing, threads_now
from vto_pipeline.cloth.dynamics.stepper import StepConfig
from vto_pipeline.errors import DivergedError

ERROR = 1e-3
"""Relative edge stretch, rms, that every size must reach; the sheet in truth stretches by a sixth of that."""

_FIRST, _MOST = 1, 1024  # substeps a frame: where the search begins, and ends
_PATIENCE = 300.0  # s; a size whose run takes longer is given up
_SCENE = f"hang at {100 * ERROR:g} % stretch"


@dataclass(frozen=True)
class PowerLaw:
    """seconds ~ vertices^exponent, with its standard error."""

    exponent: float
    uncertainty: float


def rows(quick: bool, watch: Watch) -> Iterable[Row]:
    """Measure; see the module."""
    yield from _sizes((16, 32, 48) if quick else (32, 64, 128, 256, 512), 4.0 if quick else _PATIENCE, watch)
    for count in (48,) if quick else (64, 256):
        for threads in dict.fromkeys((1, threads_now())):
            yield from kernel_rows(count, threads, watch)
    for count in (64,) if quick else (64, 256):
        yield from overhead_rows(count, watch)
    for count in (40,) if quick else (80, 160, 320):
        yield from direct_rows(count, watch)
    yield from batch_rows(10_000, 20 if quick else 200, watch)


def fit_power_law(vertices: Sequence[float], seconds: Sequence[float]) -> PowerLaw:
    """Return the exponent by least squares on logarithms, and the standard error that the scatter gives it."""
    across, up = np.log(vertices), np.log(seconds)
    across = across - across.mean()
    spread = float(across @ across)
    slope = float(across @ up) / spread
    left = up - up.mean() - slope * across
    freedom = len(across) - 2
    return PowerLaw(slope, float(np.sqrt(left @ left / freedom / spread)) if freedom > 0 else float("nan"))


def _sizes(counts: Sequence[int], patience: float, watch: Watch) -> Iterator[Row]:
    """Measure each size with the fewest substeps that reach the error, and the exponent of those that do."""
    substeps = _FIRST
    reached: list[Row] = []
    for count in counts:
        measure = partial(_cheapest, count, substeps, patience)
        row = watch.row(_SCENE, "default", {"side": count}, count**2, measure)
        yield row
        if row.errors["status"] != "reached":
            break
        reached.append(row)
        substeps = int(str(row.errors["substeps"]))
    if len(reached) > 1:
        found = fit_power_law([row.vertices for row in reached], [row.seconds for row in reached])
        errors: dict[str, Value] = {"exponent": found.exponent, "exponent_uncertainty": found.uncertainty}
        yield Row(_SCENE, "exponent", {"sizes": len(reached)}, reached[-1].vertices, 0.0, errors)


def _cheapest(count: int, substeps: int, patience: float) -> Measured:
    """Return the timing with the fewest substeps that reach ERROR, doubled from a first guess."""
    scene = hang(count)
    timing, errors = Timing(0.0), dict[str, Value]()
    while substeps <= _MOST:
        config = StepConfig.model_validate({"substeps": substeps})
        try:
            ended, timing = timed_run(scene, config, budget=patience / 10.0, most=patience)
        except DivergedError:
            substeps *= 2
            continue
        if ended is None:
            break
        errors = {**measures(scene, ended[0]), "substeps": substeps}
        if float(str(errors["rms_stretch"])) <= ERROR:
            return timing, {**errors, "status": "reached"}
        if 2.0 * timing.seconds > patience:
            break
        substeps *= 2
    return timing, {**errors, "status": "not reached"}


TRADE = Trade(("residual",), lambda quick: lambda row: row.method == "own Cholesky")
