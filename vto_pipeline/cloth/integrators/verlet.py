"""Velocity Verlet (Störmer; Swope et al. 1982): symplectic, second order."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class Verlet(Integrator):
    """x₁ = x + h v + ½h² a, v₁ = v + ½h (a + a₁): stable for h ω < 2.

    Where forces depend on velocity, a₁ is taken at the predicted v + h a, which keeps the order. It serves the next
    step as its a, unless a contact has moved the cloth in between: one force evaluation a step.
    """

    _next: tuple[FloatArray, FloatArray] | None = None

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        if self._next is not None and self._next[0] is x:
            before = self._next[1]
        else:
            before = system.acceleration(x, v)
        x = x + h * v + 0.5 * h * h * before
        after = system.acceleration(x, v + h * before)
        self._next = x, after
        return x, v + 0.5 * h * (before + after)

    def restart(self) -> None:
        """See `Integrator.restart`."""
        self._next = None
