"""The largest stable step of an explicit method, in theory and measured.

In the mode of its highest frequency a sheet that swings in its plane is a harmonic oscillator for as long as it moves
little. A method multiplies its state by a factor that depends on z = hω alone, and breaks where that exceeds
one (Hairer, Lubich & Wanner 2006, "Geometric numerical integration", I.1 and IX; Hairer & Wanner 1996, IV.2).
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from scipy.optimize import brentq

from vto_pipeline.bench.cloth.closed_forms import growth_and_frequency
from vto_pipeline.bench.stability.case import StabilityCase
from vto_pipeline.bench.stability.frequency import highest_mode
from vto_pipeline.bench.stability.trial import Maker
from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.dynamics.residual import elastic_energy
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.errors import ComputationError

STEPS = 400
"""So many steps are watched."""

_GROWN = 1e3  # of the amplitude: broken; a stable method next to its limit swings out to some dozen
_BROKEN = _GROWN ** (1.0 / STEPS)  # the same, a step
_AMPLITUDE = 1e-6  # of an edge
HIGHEST = 100.0
"""hω beyond which no limit is looked for."""

_LOWEST = 0.05  # hω at which the search begins
_EXACT = 1e-4  # of the limit, to which it is bracketed


LIMIT: dict[str, float] = {
    "explicit_euler": 0.0,
    "symplectic_euler": 2.0,
    "verlet": 2.0,
    "leapfrog": 2.0,
    "rk2": 0.0,
    "rk4": 2.0 * sqrt(2.0),
    "predictor_corrector": 1.2871885058111652,
}
"""Explicit method -> the largest hω at which its root has modulus 1, so that nothing grows. Zero: it always grows."""


def predicted_break(method: str) -> float:
    """Return the hω at which theory has an explicit method grow a thousandfold in `STEPS` steps."""
    low = max(LIMIT[method], 1e-3)
    return float(brentq(lambda z: growth_and_frequency(method, z)[0] - _BROKEN, low, 2.0 * low + 1.0, xtol=1e-12))


def measured_growth(case: StabilityCase, make: Maker, z: float) -> float:
    """Return by what factor a step of hω = z multiplies the amplitude of the highest mode, from its energy.

    Args:
        case: At rest, without gravity.
        make: The method's class.
        z: Step times frequency.

    Returns:
        The mean factor over `STEPS` steps, or until the amplitude has grown a thousandfold; infinite where it leaves
        every bound in one step.
    """
    frequency, mode = highest_mode(case.model, case.rest)
    method = make(case.model, sweeps=case.sweeps, damping=0.0, max_speed=np.inf)
    state = ClothState(case.rest + _AMPLITUDE * case.model.edge_length * mode / np.abs(mode).max(), np.zeros_like(mode))
    first = _energy(case, state)
    factor = 1.0
    for step in range(1, STEPS + 1):
        try:
            state = method.advance(state, empty_contacts(len(mode)), z / frequency, 1)
        except ComputationError:
            return np.inf
        factor = sqrt(_energy(case, state) / first) if np.isfinite(state.positions).all() else np.inf
        if not factor < _GROWN:
            return factor ** (1.0 / step)
    return factor ** (1.0 / STEPS)


def breaks_at(case: StabilityCase, make: Maker) -> tuple[float, float]:
    """Return the largest hω found to hold, and the smallest found to break; infinite where none up to 100 does."""

    def breaks(z: float) -> bool:
        return measured_growth(case, make, z) > _BROKEN

    holds, broken = 0.0, _LOWEST
    while not breaks(broken):
        if broken >= HIGHEST:
            return broken, np.inf
        holds, broken = broken, min(4.0 * broken, HIGHEST)
    while broken - holds > _EXACT * broken:
        middle = 0.5 * (holds + broken)
        holds, broken = (holds, middle) if breaks(middle) else (middle, broken)
    return holds, broken


def _energy(case: StabilityCase, state: ClothState) -> float:
    with np.errstate(all="ignore"):
        return 0.5 * float(case.model.mass @ (state.velocities**2).sum(axis=1)) + elastic_energy(
            case.model, state.positions
        )
