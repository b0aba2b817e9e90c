"""XPBD's coloured Gauss-Seidel, iterated until a large step is solved."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.build import ClothModel
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.cloth.solvers.iterated import ImplicitStep, Iterated
from vto_pipeline.cloth.solvers.linearised import Linearised
from vto_pipeline.cloth.solvers.turning import is_due, put_back
from vto_pipeline.cloth.solvers.xpbd import sweep_once
from vto_pipeline.model.arrays import FloatArray


class GaussSeidel(Iterated):
    """The sweeps of `xpbd`, which with many of them also end where backward Euler does; see `turning`.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self.linear = Linearised(self.model)

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return λ of each kind of constraint at the end of the last step, shape (N, B) each."""
        return self.linear.multipliers

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        self.linear.reset()
        pressed = np.zeros((len(step.contacts.friction), *x.shape))
        for sweep in range(1, self.sweeps + 1):
            self.sweep(step, x, pressed)
            if is_due(sweep, self.sweeps):
                put_back(self.linear, self.model, step, x, pressed)

    def sweep(self, step: ImplicitStep, x: FloatArray, pressed: FloatArray) -> None:
        """Do one sweep on x [m], λ and the pushes [kg m] of planes, in place."""
        model, threaded = self.model, len(x) >= PARALLEL_FROM
        args = (x, step.start, model.inverse_mass, model.constraints, self.multipliers, step.contacts, pressed)
        sweep_once(*args, step.t0, step.t1, step.h, threaded)
