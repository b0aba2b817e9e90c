"""A time integrator of forces as a method that moves a cloth."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts, empty_contacts
from vto_pipeline.cloth.collision.response.step_response import resolve_plane_contacts
from vto_pipeline.cloth.collision.self_collision.pairs import Pairs, no_pairs
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.constraints.rigid import refuse_rigid
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.model.internal_friction import copy_sliders, restore_sliders, slip, with_own_sliders
from vto_pipeline.model.arrays import FloatArray


class Integrator(ABC):
    """What all integrators share; each adds its `step`.

    Args:
        model: The cloth.
        sweeps: Not used: a step of an integrator is a step.
        damping: Rayleigh's mass term α, rate at which velocities fade [1/s].
        max_speed: No vertex moves faster [m/s].
        air: Drag of the air, ½ρc [kg/m³].
        tolerance: How nearly implicit equations are solved, as a share of an edge's length.

    Attributes:
        system: The forces.
        tolerance: [m].
        self_contact: What keeps the cloth from itself where contacts are forces, if anything; may be set between runs.
    """

    def __init__(
        self,
        model: ClothModel,
        *,
        sweeps: int = 1,
        damping: float = 0.0,
        max_speed: float = np.inf,
        air: float = 0.0,
        tolerance: float = 1e-5,
    ) -> None:
        self.tolerance = tolerance * model.edge_length
        self._model = with_own_sliders(model)
        self.system = ForceSystem(self._model, damping, air)
        self._max_speed = max_speed
        self.self_contact: SelfContact | None = None
        self._h = 0.0
        self._last: ClothState | None = None

    @abstractmethod
    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Return positions [m] and velocities [m/s] after one step of h [s], shape (V, 3) each; x and v are kept."""

    def restart(self) -> None:  # noqa: B027  # methods without memory have nothing to forget
        """Forget earlier steps: the next one continues another motion, or has another length."""

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span.

        Raises:
            ConfigError: a constraint is rigid.
        """
        if self._last is None:
            refuse_rigid(self._model.constraints, state.positions, type(self).__name__)
        if state is not self._last or h != self._h:
            self.restart()
        restore_sliders(self._model, state.sliders)
        x, v = state.positions, self.system.free * state.velocities
        with np.errstate(over="ignore", invalid="ignore"):  # beyond its limit of stability a method grows until inf
            for step in range(substeps):
                t0, t1, penalty = step / substeps, (step + 1) / substeps, self.system.penalty
                if penalty is None:
                    new_x, new_v = self.step(self.system, x, v, h)
                    x, v = self._respond(x, new_x, new_v, contacts, t0, t1, h)
                else:
                    x = x.copy()  # what was kept for a step from here was without its contacts
                    penalty.begin(contacts, self._pairs(x, v, state.time + step * h, h), t0, t1, x, h)
                    new_x, new_v = self.step(self.system, x, v, h)
                    x, v = self._respond(x, new_x, new_v, empty_contacts(len(x)), t0, t1, h)
                    penalty.end(x)
                slip(x, self._model.constraints)
        self._h, self._last = h, ClothState(x, v, state.time + substeps * h, copy_sliders(self._model))
        return self._last

    def _pairs(self, x: FloatArray, v: FloatArray, time: float, h: float) -> Pairs:
        """Return where the cloth comes near itself and what bodies have beside faces."""
        if self.self_contact is None:
            return no_pairs()
        self.self_contact.set_time_span(time, time + h)
        return self.self_contact.find_pairs(x, x + h * v + h * h * self._model.gravity, h, h * v)

    def _respond(
        self, start: FloatArray, x: FloatArray, v: FloatArray, contacts: Contacts, t0: float, t1: float, h: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return x and v in front of the contacts: what moved a vertex by d changed its speed by d/h."""
        if not len(contacts.friction) and self._max_speed == np.inf:
            return x, v
        moved, speed = x.copy(), np.zeros_like(v)
        threaded = len(x) >= PARALLEL_FROM
        longest = self._max_speed * h
        resolve_plane_contacts(
            moved, speed, start, self._model.inverse_mass, contacts, t0, t1, h, longest, True, threaded
        )
        return moved, v + (moved - x) / h
