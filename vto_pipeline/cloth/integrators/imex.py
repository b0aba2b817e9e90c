"""Implicit-explicit Euler: springs are implicit, what resists motion is explicit (Eberhardt, Etzmuß & Hauth 2000)."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton_step
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Imex(Integrator):
    """v* = v + h M⁻¹ r(x, v) explicitly, then one linearly implicit step of the elastic forces and gravity from v*.

    Gravity is constant: explicit and implicit are the same. The matrix has no term of damping or drag, and their
    share sets the limit of stability, h < 2/(α + β ω²).
    """

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        slowed = v + h * system.inverse_mass * system.resistance(x, v)[1]
        step = IncrementalPotential(system, x + h * slowed, h * h, x, np.inf, x)
        new = newton_step(step, x, np.zeros_like(v))
        return new, (new - x) / h
