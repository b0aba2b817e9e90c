"""Shared parts of methods that iterate on one implicit step at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import exp

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.collision.response.step_response import resolve_plane_contacts
from vto_pipeline.cloth.constraints.rigid import refuse_rigid
from vto_pipeline.cloth.constraints.sweep import PARALLEL_FROM
from vto_pipeline.cloth.implicit_step.dual_system import Linearised
from vto_pipeline.cloth.implicit_step.prediction import predict
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.model.internal_friction import copy_sliders, restore_sliders, slip, with_own_sliders
from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class ImplicitStep:
    """M (x - x̃) = ∇Cᵀ λ + p, C + α̃ λ + γ ∇C (x - xⁿ) = 0, with pushes p of planes that x must stay in front of.

    Args:
        start: Positions at its begin, xⁿ [m], shape (V, 3).
        target: Where vertices would be without constraints, x̃ [m], shape (V, 3).
        h: Length [s].
        contacts: Planes.
        t0, t1: Begin and end, as shares of the span of the contacts.
    """

    start: FloatArray
    target: FloatArray
    h: float
    contacts: Contacts
    t0: float
    t1: float

    def planes(self) -> tuple[FloatArray, FloatArray]:
        """Return the planes at the end as n·x >= d: n, shape (S, V, 3), and d [m], shape (S, V)."""
        contacts, t = self.contacts, self.t1
        normals, points, offsets = (
            now[:, :, 0] + t * (now[:, :, 1] - now[:, :, 0])
            for now in (contacts.normal, contacts.point, contacts.offset)
        )
        length = np.linalg.norm(normals, axis=2, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        return normals, (normals * points).sum(axis=2) + offsets


class Iterated(ABC):
    """A method that takes each step from x̃ with this many iterations.

    Args:
        model: The cloth.
        sweeps: Iterations a step.
        damping: Rate at which velocities fade [1/s].
        max_speed: No vertex moves faster [m/s].

    Attributes:
        takes_rigid: Whether a compliance of zero is allowed.
    """

    takes_rigid = True
    has_exact_rest = False

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        self.model = with_own_sliders(model)
        self.sweeps = sweeps
        self._damping = damping
        self._max_speed = max_speed
        self._checked = self.takes_rigid

    @abstractmethod
    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """Move x [m], shape (V, 3), from x̃ towards the solution of the step."""

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span.

        Raises:
            ConfigError: a constraint is rigid, and the method needs stiffnesses.
        """
        model, threaded = self.model, len(state.positions) >= PARALLEL_FROM
        if not self._checked:
            refuse_rigid(model.constraints, state.positions, type(self).__name__)
            self._checked = True
        restore_sliders(model, state.sliders)
        x, v, start = state.positions.copy(), state.velocities.copy(), np.empty_like(state.positions)
        fall = (h * model.gravity[0], h * model.gravity[1], h * model.gravity[2])
        for number in range(substeps):
            t0, t1 = number / substeps, (number + 1) / substeps
            predict(x, v, start, model.inverse_mass, fall, h, exp(-self._damping * h), threaded)
            with np.errstate(over="ignore", invalid="ignore"):  # what grows without bound is found by who called
                self.solve(ImplicitStep(start, x.copy(), h, contacts, t0, t1), x)
            resolve_plane_contacts(
                x, v, start, model.inverse_mass, contacts, t0, t1, h, self._max_speed * h, True, threaded
            )
            slip(x, model.constraints)
        return ClothState(x, v, state.time + substeps * h, copy_sliders(model))


class DualIterated(Iterated):
    """A method whose iterations work on the multipliers of the linearised step.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.

    Attributes:
        linear: The linearised step, with λ.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self.linear = Linearised(self.model)

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return λ of each kind of constraint at the end of the last step, shape (N, B) each."""
        return self.linear.multipliers
