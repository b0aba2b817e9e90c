"""Newton's method on the incremental potential."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.block_matrix import multiply

_ITERATIONS = 50
_LINEAR_TOLERANCE = 1e-4  # the error left after an iteration, as a share of that before it
_SINGLE_TOLERANCE = 1e-8  # where no further iteration mends it
_ARMIJO = 1e-4


def newton_step(potential: IncrementalPotential, x: FloatArray, v: FloatArray) -> FloatArray:
    """Return where one linear system leads, with forces linearised about x and v: Baraff & Witkin 1998, eq. 6.

    Φ linearised about x alone has the resistance about u = (x - o)/τ, and not about v; what that makes,
    r(v) - r(u) - (∂r/∂v) (v - u), is added.
    """
    system = potential.system
    gradient = potential.at(x)[1]
    if potential.resisted:
        begin = potential.velocity(x)
        elastic, whole = np.empty_like(v), np.empty_like(v)
        multiply(system.matrix(x, v, 1.0 / potential.square, 0.0), v - begin, elastic)
        multiply(potential.hessian(x, v), v - begin, whole)
        change = system.resistance(potential.around, v)[1] - system.resistance(potential.around, begin)[1]
        gradient -= system.free * (change + potential.span * (whole - elastic))
    else:
        potential.hessian(x, v)
    return x + system.solve(-gradient, _SINGLE_TOLERANCE)


def newton(potential: IncrementalPotential, y: FloatArray, tolerance: float) -> FloatArray:
    """Return a minimum of Φ to within this tolerance [m], searched from y [m], shape (V, 3).

    The matrix is positive definite, so every direction leads down and a line search finds a lower point (Nocedal &
    Wright 2006, section 3.3). What 50 iterations reach is returned: lower than the start in any case.
    """
    value, gradient = potential.at(y)
    before = 0.0
    for _ in range(_ITERATIONS):
        potential.hessian(y, potential.velocity(y))
        direction = potential.system.solve(-gradient, _LINEAR_TOLERANCE)
        size = float(np.abs(direction).max())
        left = size * min(1.0, size / before) if before > 0.0 else size  # steps go on shrinking as they did
        if not left > tolerance:
            return y + direction
        before = size
        slope = float(np.vdot(gradient, direction))
        share = 1.0
        while True:
            trial = y + share * direction
            trial_value, trial_gradient = potential.at(trial)
            if lower(value, slope, share, trial_value, float(np.vdot(trial_gradient, direction))):
                break
            share *= 0.5
            if share < 1e-9:
                return y
        y, value, gradient = trial, trial_value, trial_gradient
    return y


def lower(value: float, slope: float, share: float, new_value: float, new_slope: float) -> bool:
    """Return whether a step goes far enough down.

    Armijo's condition, or where the difference of two energies is only rounding, that of Hager & Zhang 2005 (eq. 4.1)
    on the slopes.
    """
    if new_value <= value + _ARMIJO * share * slope:
        return True
    return new_value <= value + 1e-10 * abs(value) and abs(new_slope) <= 0.9 * abs(slope)
