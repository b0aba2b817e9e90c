"""Explicit Euler: gains energy at any step size. Kept as the negative control of the benches."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class ExplicitEuler(Integrator):
    """x₁ = x + h v, v₁ = v + h a(x, v): first order."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        return x + h * v, v + h * system.acceleration(x, v)
