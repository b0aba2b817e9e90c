"""Linearly implicit Euler: one Newton step a time step (Baraff & Witkin 1998)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton_step
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class BackwardEuler(Integrator):
    """(M + h²K + h ∂r) Δv = h (f + r) - h² K v, first order: one linear system, and no line search."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = newton_step(step, x, v)
        return new, step.velocity(new)
