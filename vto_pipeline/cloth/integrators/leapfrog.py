"""Leapfrog: positions at whole steps, velocities halfway between them."""

from __future__ import annotations

from dataclasses import replace

from vto_pipeline.cloth.build import ClothState
from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


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
