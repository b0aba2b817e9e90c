"""XPBD's coloured Gauss-Seidel, iterated until a large step is solved."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.cloth.implicit_step.geometric_stiffness import is_drift_removal_due, remove_primal_drift
from vto_pipeline.cloth.implicit_step.iterated import DualIterated, ImplicitStep
from vto_pipeline.cloth.solvers.xpbd import sweep_once
from vto_pipeline.model.arrays import FloatArray


class GaussSeidel(DualIterated):
    """The sweeps of `xpbd`, which with many of them also end where backward Euler does; see `geometric_stiffness`.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        self.linear.reset()
        pressed = np.zeros((len(step.contacts.friction), *x.shape))
        for sweep in range(1, self.sweeps + 1):
            self.sweep(step, x, pressed)
            if is_drift_removal_due(sweep, self.sweeps):
                remove_primal_drift(self.linear, self.model, step, x, pressed)

    def sweep(self, step: ImplicitStep, x: FloatArray, pressed: FloatArray) -> None:
        """Do one sweep on x [m], λ and the pushes [kg m] of planes, in place."""
        model, threaded = self.model, len(x) >= PARALLEL_FROM
        args = (x, step.start, model.inverse_mass, model.constraints, self.multipliers, step.contacts, pressed)
        sweep_once(*args, step.t0, step.t1, step.h, threaded)
