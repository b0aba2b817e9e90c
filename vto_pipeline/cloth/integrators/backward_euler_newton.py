"""Backward Euler solved to convergence."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class BackwardEulerNewton(Integrator):
    """x₁ = x + h v₁, v₁ = v + h a(x₁, v₁): first order, no energy gained at any h, spin lost."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)
