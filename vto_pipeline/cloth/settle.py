"""Waiting for rest, to a stated error: the motion still to come, and what the step size falsifies."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vto_pipeline.cloth.build import ClothState
from vto_pipeline.cloth.stepper import Stepper
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.cloth import TraceRow

_WINDOW = 0.1  # s of cloth time between looks
_QUIET = 3  # looks in a row under the bound: an oscillating cloth stands still for an instant at each turn
_COARSE = 2.0  # times the bound: waiting longer for a coarse answer, itself in error by more, is waste
_STILL = 0.1  # times the bound: what moves no farther is at rest, whatever force a few contacts argue about
_SLOWEST = 0.95  # a decay slower than this cannot be told from none


@dataclass(frozen=True)
class SettleLimits:
    """When to stop.

    Args:
        error: Predicted distance to the state of rest, rms over vertices [m].
        residual: And left-over force, as a share of weight, by methods whose state of rest is exact.
        seconds: Cloth time at most [s].
        finest: Steps per 1/60 s that are not refined further.
        deadline: `time.perf_counter` at which to stop; without effect on the result unless it is reached.
    """

    error: float
    residual: float
    seconds: float
    finest: int
    deadline: float = np.inf


@dataclass
class Settling:
    """How it went.

    Args:
        state: At the end.
        settled: Whether a bound was reached.
        error: Predicted distance to the state of rest, rms over vertices [m]; infinite while unknown.
        residual: Out-of-balance force as a share of weight.
        trace: One row for each look.
    """

    state: ClothState
    settled: bool = False
    error: float = np.inf
    residual: float = np.inf
    trace: list[TraceRow] = field(default_factory=list)


def settle(
    stepper: Stepper,
    state: ClothState,
    limits: SettleLimits,
    watch: Callable[[float, float], None] = lambda done, error: None,
) -> Settling:
    """Run until rest; where that depends on the steps, halve them until halving changes no more than the bound.

    The moves d of successive windows shrink by q, so d q / (1 - q) is still to come. A method that solves each step
    only in part, as one sweep of Gauss-Seidel does, leaves an error of order h² in the state of rest, so halving h
    shows three quarters of it (Richardson) and a third of that is left.

    Args:
        stepper: The cloth among its colliders; its steps are refined.
        state: Where to begin.
        limits: When to stop.
        watch: Told the share of time used and the error [m] at each look.
    """
    began = time.perf_counter()
    result = Settling(state)
    moves: list[float] = []
    coarse: FloatArray | None = None
    quiet = 0
    stepper.prepare(state.positions)
    exact = stepper.rests_exactly
    while result.state.time - state.time < limits.seconds and time.perf_counter() < limits.deadline:
        before = result.state.positions
        result.state = stepper.run(result.state, _WINDOW)
        moves.append(_rms(result.state.positions - before))
        to_come = _still_to_come(moves)
        result.error = to_come
        if not exact:
            result.error += np.inf if coarse is None else _rms(result.state.positions - coarse) / 3.0
        result.residual = stepper.residual(result.state)
        seconds = time.perf_counter() - began
        row = TraceRow(seconds, stepper.steps, 1e3 * result.error, result.residual, contacts=stepper.bearing)
        result.trace.append(row)
        watch((result.state.time - state.time) / limits.seconds, result.error)
        first = coarse is None and not exact
        bound = _COARSE * limits.error if first else (1.0 if exact else 0.5) * limits.error
        balanced = result.residual < limits.residual or not exact or to_come < _STILL * bound
        quiet = quiet + 1 if to_come < bound and balanced else 0
        if quiet < _QUIET:
            continue
        if result.error < limits.error:
            result.settled = True
            break
        if 2 * stepper.substeps > limits.finest:
            break
        coarse, moves, quiet = result.state.positions, [], 0
        stepper.substeps *= 2
    return result


def _rms(moves: FloatArray) -> float:
    return float(np.sqrt((moves**2).sum(axis=1).mean()))


def _still_to_come(moves: list[float]) -> float:
    """Return the sum of the moves to come if they go on shrinking as the last four did [m]."""
    if len(moves) < 4:
        return np.inf
    last, before = max(moves[-2:]), max(moves[-4:-2])
    shrink = min(np.sqrt(last / before), _SLOWEST) if before > 0.0 else 0.0
    return float(last * max(shrink / (1.0 - shrink), 1.0))
