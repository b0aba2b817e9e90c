"""Explicit one-step methods: forces at known positions, and no system to solve."""

from __future__ import annotations

from dataclasses import replace

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.cloth.model.build import ClothState
from vto_pipeline.model.arrays import FloatArray


class ExplicitEuler(Integrator):
    """x₁ = x + h v, v₁ = v + h a(x, v): first order. It gains energy at any h: the negative control of the benches."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        return x + h * v, v + h * system.acceleration(x, v)


class SymplecticEuler(Integrator):
    """v₁ = v + h a(x, v), x₁ = x + h v₁: first order, stable for h ω < 2 (Hairer, Lubich & Wanner 2006, I.1.9)."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        v = v + h * system.acceleration(x, v)
        return x + h * v, v


class Verlet(Integrator):
    """Velocity Verlet (Störmer; Swope et al. 1982): x₁ = x + h v + ½h² a, v₁ = v + ½h (a + a₁); symplectic.

    Second order, stable for h ω < 2. Where forces depend on velocity, a₁ is taken at the predicted v + h a, which keeps
    the order. It serves the next step as its a, unless a contact has moved the cloth in between: one force evaluation a
    step.
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


class Leapfrog(Integrator):
    """v₊ = v₋ + h a(x, v₋), x₁ = x + h v₊: symplectic, second order, stable for h ω < 2.

    Velocities run half a step behind, and so does what depends on them: damping is of first order. The first kick of a
    call lasts h/2, and another after the last step brings the velocity up to the time (Birdsall & Langdon 1985, 2-4).
    """

    _begun = False

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        v = v + (h if self._begun else 0.5 * h) * system.acceleration(x, v)
        self._begun = True
        return x + h * v, v

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """See `Integrator.advance`."""
        self._begun = False
        end = super().advance(state, contacts, h, substeps)
        kick = 0.5 * h * self.system.acceleration(end.positions, end.velocities)
        return replace(end, velocities=end.velocities + kick)


class Rk2(Integrator):
    """The explicit midpoint rule, second order: an undamped oscillator grows by √(1 + (hω)⁴/4) a step."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        middle = v + 0.5 * h * system.acceleration(x, v)
        return x + h * middle, v + h * system.acceleration(x + 0.5 * h * v, middle)


class Rk4(Integrator):
    """Kutta's classical method of fourth order (1901): four evaluations a step.

    Stable for h ω < 2√2, and below that limit it loses a little energy.
    """

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
