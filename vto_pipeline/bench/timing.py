"""Run time as reported everywhere: after compilation, the median of at least three runs."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numba

import vto_pipeline.numerics  # noqa: F401  # finds the thread pool, before Numba looks for one

Result = TypeVar("Result")

RUNS = 3
BUDGET = 60.0
"""A run longer than this is not repeated [s]; `Timing.runs` says so."""


@dataclass(frozen=True)
class Timing:
    """How long something takes.

    Args:
        seconds: Median wall time [s].
        runs: Of how many runs.
        compile_s: What the first call took [s]; zero when there was none.
        spread_s: From the shortest to the longest run [s]; None where there was only one.
    """

    seconds: float
    runs: int = 1
    compile_s: float = 0.0
    spread_s: float | None = None

    @classmethod
    def of(cls, walls: Sequence[float], compile_s: float = 0.0) -> Timing:
        """Return the timing of repeated runs from their wall times [s]."""
        spread = max(walls) - min(walls) if len(walls) > 1 else None
        return cls(statistics.median(walls), len(walls), compile_s, spread)


def timed(
    run: Callable[[], Result], *, warm: Callable[[], object] | None = None, runs: int = RUNS, budget: float = BUDGET
) -> tuple[Result, Timing]:
    """Return what the last run returned, and the timing.

    Args:
        run: What is timed; each call must do the same work.
        warm: A short piece of the same work, run first so that nothing is compiled on the clock.
        runs: How often, if time allows.
        budget: Wall time after which no further run begins [s].
    """
    compile_s = clocked(warm)[1] if warm is not None else 0.0
    result, seconds = clocked(run)
    walls = [seconds]
    while len(walls) < runs and sum(walls) + walls[-1] <= runs * budget and walls[-1] <= budget:
        result, seconds = clocked(run)
        walls.append(seconds)
    return result, Timing.of(walls, compile_s)


def threads_now() -> int:
    """Return how many threads the kernels can use now."""
    return int(numba.get_num_threads())


def clocked(run: Callable[..., Result], *arguments: Any) -> tuple[Result, float]:
    """Return what a call returns, and its wall time [s]."""
    began = time.perf_counter()
    result = run(*arguments)
    return result, time.perf_counter() - began
