"""Minimisers of the incremental potential: Newton's method and nonlinear conjugate gradients."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.line_search import backtracking_shares, satisfies_armijo
from vto_pipeline.numerics.linear.block_matrix import multiply

_NEWTON_ITERATIONS = 50
_CG_ITERATIONS = 500
_LINEAR_TOLERANCE = 1e-4  # the error left after an iteration, as a share of that before it
_SINGLE_TOLERANCE = 1e-8  # where no further iteration mends it
_SHORTEST = 1e-9  # share of a Newton step
_SLACK = 0.1  # a line is searched well enough when the slope has fallen to this share


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
    for _ in range(_NEWTON_ITERATIONS):
        potential.hessian(y, potential.velocity(y))
        direction = potential.system.solve(-gradient, _LINEAR_TOLERANCE)
        size = float(np.abs(direction).max())
        left = size * min(1.0, size / before) if before > 0.0 else size  # steps go on shrinking as they did
        if not left > tolerance:
            return y + direction
        before = size
        slope = float(np.vdot(gradient, direction))
        for share in backtracking_shares(_SHORTEST):
            trial = y + share * direction
            trial_value, trial_gradient = potential.at(trial)
            if satisfies_armijo(value, slope, share, trial_value, float(np.vdot(trial_gradient, direction))):
                break
        else:
            return y
        y, value, gradient = trial, trial_value, trial_gradient
    return y


def conjugate_gradients(potential: IncrementalPotential, y: FloatArray, tolerance: float) -> FloatArray:
    """Return a minimum of Φ, searched from y until steps are within the tolerance [m], shape (V, 3).

    Nocedal & Wright 2006, section 5.2: Polak and Ribière's β with restarts, the same as Fletcher and Reeves' on a
    quadratic and safer off it; the preconditioner is the inverse of the diagonal blocks. What 500 iterations reach is
    returned: lower than the start in any case.
    """
    matrix = potential.hessian(y, potential.velocity(y))
    inverse = np.linalg.inv(matrix.blocks[matrix.diagonal])
    value, gradient = potential.at(y)
    steepest = (inverse @ gradient[:, :, None])[:, :, 0]
    direction, share = -steepest, 1.0
    for _ in range(_CG_ITERATIONS):
        norm = float(np.vdot(gradient, steepest))
        slope = float(np.vdot(gradient, direction))
        if slope >= 0.0:
            direction, slope = -steepest, -norm
        found = _search(potential, y, direction, value, slope, share)
        if found is None:
            break
        share, y, value, new_gradient = found
        change, gradient = new_gradient - gradient, new_gradient
        if not share * np.abs(direction).max() > tolerance:
            break
        steepest = (inverse @ gradient[:, :, None])[:, :, 0]
        direction = max(0.0, float(np.vdot(change, steepest)) / norm) * direction - steepest
    return y - potential.system.shift(gradient)


def _search(
    potential: IncrementalPotential, y: FloatArray, direction: FloatArray, value: float, slope: float, share: float
) -> tuple[float, FloatArray, float, FloatArray] | None:
    """Return the share of the direction to go, and what is there; None when nothing lower is found.

    The secant of the slope gives Newton's step length; from there it is halved until Φ has fallen.
    """
    refined = False
    while share > 1e-12:
        trial = y + share * direction
        trial_value, gradient = potential.at(trial)
        trial_slope = float(np.vdot(gradient, direction))
        if not refined and abs(trial_slope) > _SLACK * abs(slope) and trial_slope > slope:
            share *= slope / (slope - trial_slope)
        elif satisfies_armijo(value, slope, share, trial_value, trial_slope):
            return share, trial, trial_value, gradient
        else:
            share *= 0.5
        refined = True
    return None
