"""Symplectic (semi-implicit) Euler: one force evaluation, no drift of energy."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class SymplecticEuler(Integrator):
    """v₁ = v + h a(x, v), x₁ = x + h v₁: first order, stable for h ω < 2 (Hairer, Lubich & Wanner 2006, I.1.9)."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        v = v + h * system.acceleration(x, v)
        return x + h * v, v
