"""Newmark's method of structural dynamics (Newmark 1959)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Newmark(Integrator):
    """x₁ = x + h v + h² ((½ - β) a + β a₁), v₁ = v + h ((1 - γ) a + γ a₁).

    Attributes:
        beta: β > 0. With 1/4, the average acceleration, a linear system neither gains nor loses energy.
        gamma: γ. 1/2 gives second order; above it, high frequencies are damped.
    """

    beta = 0.25
    gamma = 0.5

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        a = system.acceleration(x, v)
        ahead = x + h * v + (0.5 - self.beta) * h * h * a
        square, span = self.beta * h * h, self.beta * h / self.gamma
        known = v + (1.0 - self.gamma) * h * a
        step = IncrementalPotential(system, ahead, square, ahead - span * known, span, ahead)
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)
