"""Convergence of each solver's iterations on one frozen implicit step of a falling sheet."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from vto_pipeline.bench.bench import Measured, Row, Watch
from vto_pipeline.bench.cloth.scenes import hang
from vto_pipeline.bench.timing import Timing
from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.implicit_step.frozen_step import FrozenStep, frozen_step, residual_history
from vto_pipeline.cloth.model.build import at_rest
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.model.arrays import FloatArray

_H = FRAME / 4.0  # [s]
_SOLVED_BY, _SOLVED_IN = "fast_projection", 20  # Newton with a direct solve; six iterations bring it to rounding


def iteration_rows(count: int, most: int, patience: float, watch: Watch) -> Iterator[Row]:
    """Measure 1, 2, 4, ... iterations on a sheet of count x count vertices.

    Args:
        count: Vertices a side.
        most: Iterations at most.
        patience: A solver whose step takes longer gets no more iterations [s].
        watch: For progress and known rows.
    """
    problem = cache(lambda: _problem(count))
    for method in SOLVERS:
        iterations = 1
        while iterations <= most:

            def measure(method: str = method, iterations: int = iterations) -> Measured:
                return _measure(method, iterations, *problem())

            row = watch.row(f"one step, hang {count}", method, {"iterations": iterations}, count**2, measure)
            yield row
            if row.seconds > patience:
                break
            iterations *= 2


def _problem(count: int) -> tuple[FrozenStep, FloatArray]:
    """Return a step of the sheet that has just been let go, and the positions that solve it."""
    scene = hang(count)
    step = frozen_step(scene.model, at_rest(scene.start), _H)
    exact: Any = SOLVERS[_SOLVED_BY](step.model, sweeps=_SOLVED_IN)
    return step, exact.advance(step.state, step.contacts, step.h, 1).positions


def _measure(method: str, iterations: int, step: FrozenStep, solution: FloatArray) -> Measured:
    solver: Any = SOLVERS[method]
    (reached,) = residual_history(solver, step, [iterations], solution)
    errors = {"imbalance_mm": 1e3 * reached.imbalance, "from_solution_mm": 1e3 * reached.distance}
    return Timing(reached.seconds), errors
