"""Steps as long as the motion allows: longer than usual where cloth hardly speeds up."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.dynamics.stepper import Stepper
from vto_pipeline.cloth.model.build import ClothState

_LONGEST = 4.0  # times the usual step: in longer ones the solver leaves out too much
_GROWS = 2.0  # times, from step to step
_WRONG = 2.0  # times the error that is allowed: a step is taken back


def run_at_own_pace(stepper: Stepper, state: ClothState, seconds: float) -> ClothState:
    """Return the state after so much simulated time [s]; earlier where the stepper is out of time.

    Backward Euler misses ½ h² a in a step of h (its local error), where damping comes first and a is what all other
    forces drive. In usual steps, cloth that falls freely so loses ½ h g in a second. Where the stepper may choose, no
    vertex loses more: a step is as much longer as the largest a is below g.

    Raises:
        DivergedError: a position is no longer finite.
    """
    stepper.prepare(state.positions)
    if not stepper.may_lengthen_steps:
        return stepper.run(state, seconds)
    end = state.time + seconds
    usual = step = stepper.step
    allowed = usual * stepper.free_fall
    while (left := end - state.time) > 1e-9 * usual and not stepper.out_of_time:
        taken = left if round(left / step) <= 1 else step
        stepper.substeps = FRAME / taken
        memory, before = stepper.contact_memory, state
        state = stepper.run(before, taken)
        gained = float(stepper.driven(before, state).max(initial=0.0))  # h a
        if gained > _WRONG * allowed and taken > 1.5 * usual:
            stepper.contact_memory, state, step = memory, before, usual
        else:
            longest = min(_GROWS * taken, _LONGEST * usual)
            step = float(np.clip(taken * allowed / max(gained, 1e-12), usual, longest))
    stepper.substeps = FRAME / usual
    return state
