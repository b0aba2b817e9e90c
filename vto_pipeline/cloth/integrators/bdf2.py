"""Backward differentiation of second order (Gear 1971; for cloth Choi & Ko 2002)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Bdf2(Integrator):
    """y₁ = 4/3 y - 1/3 y₋ + 2/3 h y'₁: less loss than backward Euler, still none too stiff.

    With no step behind it, the first is backward Euler's: its error of h² enters once and keeps the order.
    """

    _before: tuple[FloatArray, FloatArray] | None = None

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        if self._before is None:
            step = IncrementalPotential.of_backward_euler(system, x, v, h)
        else:
            x_before, v_before = self._before
            span = 2.0 / 3.0 * h
            origin = (4.0 * x - x_before) / 3.0
            ahead = origin + span * (4.0 * v - v_before) / 3.0
            step = IncrementalPotential(system, ahead, span * span, origin, span, ahead)
        self._before = x, v
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)

    def restart(self) -> None:
        """See `Integrator.restart`."""
        self._before = None
