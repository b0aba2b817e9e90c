"""Step halving until the motion changes by no more than a stated error."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.model.cloth import TraceRow


@dataclass
class RefinedTrajectory:
    """A motion and how well it is known.

    Args:
        state: At its end; at the deadline if not even the coarsest run was done by then.
        stepper: The last one, with its choice and counts.
        error: Distance to the end of the motion in half the steps, rms over vertices [m]; infinite while unknown.
            The methods are of first order at least, so the next halving would change no more than that again.
        trace: One row for each run.
    """

    state: ClothState
    stepper: Stepper
    error: float = np.inf
    trace: list[TraceRow] = field(default_factory=list)


def refine_time_step(
    make: Callable[[float | None], Stepper],
    start: ClothState,
    seconds: float,
    *,
    error: float,
    finest: int,
    deadline: float = np.inf,
) -> RefinedTrajectory:
    """Run a motion with steps halved until its error is known to be small enough, or time is up.

    Args:
        make: Returns a cloth among its colliders for this many steps per 1/60 s; None: the method's own number.
        start: Where it begins.
        seconds: How long it lasts [s].
        error: To reach [m].
        finest: Steps per 1/60 s that are not refined further.
        deadline: `time.perf_counter` by which to be done: a run is not begun that would not be.
    """
    began = time.perf_counter()
    stepper = make(None)
    stepper.deadline = deadline
    result = RefinedTrajectory(stepper.run(start, seconds), stepper)
    while True:
        spent = time.perf_counter() - began
        rms = float(1e3 * result.error)
        result.trace.append(TraceRow(spent, result.stepper.steps, rms, result.stepper.residual(result.state)))
        last = spent - (result.trace[-2].seconds if len(result.trace) > 1 else 0.0)
        late = time.perf_counter() + 2.0 * last > deadline
        if result.error <= error or late or 2 * result.stepper.substeps > finest:
            return result
        stepper = make(2 * result.stepper.substeps)
        state = stepper.run(start, seconds)
        moved = state.positions - result.state.positions
        result.error = float(np.sqrt((moved**2).sum(axis=1).mean()))
        result.state, result.stepper = state, stepper
