"""Backward Euler by nonlinear conjugate gradients on the incremental potential: no linear system is solved.

Frâncu 2015 for the method on cloth; Nocedal & Wright 2006, section 5.2, for Polak and Ribière's β with restarts, the
same as Fletcher and Reeves' on a quadratic and safer off it; the preconditioner is the inverse of the diagonal blocks.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import lower
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray

_ITERATIONS = 500
_SLACK = 0.1  # a line is searched well enough when the slope has fallen to this share


class Ncg(Integrator):
    """x₁ = x + h v₁, v₁ = v + h a(x₁, v₁): first order."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = _minimum(step, x, self.tolerance)
        return new, step.velocity(new)


def _minimum(potential: IncrementalPotential, y: FloatArray, tolerance: float) -> FloatArray:
    """Return a minimum of Φ, searched from y until steps are within the tolerance [m], shape (V, 3).

    What 500 iterations reach is returned: lower than the start in any case.
    """
    matrix = potential.hessian(y, potential.velocity(y))
    inverse = np.linalg.inv(matrix.blocks[matrix.diagonal])
    value, gradient = potential.at(y)
    steepest = (inverse @ gradient[:, :, None])[:, :, 0]
    direction, share = -steepest, 1.0
    for _ in range(_ITERATIONS):
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
            refined = True
        elif lower(value, slope, share, trial_value, trial_slope):
            return share, trial, trial_value, gradient
        else:
            share *= 0.5
            refined = True
    return None
