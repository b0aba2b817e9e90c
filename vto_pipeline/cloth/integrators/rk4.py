"""The classical Runge-Kutta method of fourth order (Kutta 1901)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Rk4(Integrator):
    """Four evaluations a step; stable for h ω < 2√2, and below that limit it loses a little energy."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        a1 = system.acceleration(x, v)
        v2 = v + 0.5 * h * a1
        a2 = system.acceleration(x + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * a2
        a3 = system.acceleration(x + 0.5 * h * v2, v3)
        v4 = v + h * a3
        a4 = system.acceleration(x + h * v3, v4)
        return x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
