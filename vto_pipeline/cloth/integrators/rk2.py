"""Runge-Kutta of second order: the explicit midpoint rule."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Rk2(Integrator):
    """One evaluation at the start and one in the middle; an undamped oscillator grows by √(1 + (hω)⁴/4) a step."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        middle = v + 0.5 * h * system.acceleration(x, v)
        return x + h * middle, v + h * system.acceleration(x + 0.5 * h * v, middle)
