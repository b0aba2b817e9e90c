"""Iterations on all multipliers of a step at once: λ ← λ + a D⁻¹ r + b Δλ, with the factors a and b of a method."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.implicit_step.dual_system import inner
from vto_pipeline.cloth.implicit_step.geometric_stiffness import is_drift_removal_due, remove_primal_drift
from vto_pipeline.cloth.implicit_step.iterated import DualIterated, ImplicitStep
from vto_pipeline.cloth.implicit_step.plane_multiplier import solve_plane_contacts
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.model.arrays import FloatArray

_GROWTH = 10.0  # of rᵀ D⁻¹ r since it was smallest: gradients have turned, and the acceleration begins anew


class DualDescent(DualIterated):
    """A method that changes all multipliers at once along D⁻¹ r, linearised anew in each iteration.

    Acceleration rests on a linear problem. While a sheet is thrown about it is not, and what was gathered is dropped as
    soon as the residual grows.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self._prepared = False
        self._along = tuple(np.zeros_like(one) for one in self.linear.multipliers)
        self._change = tuple(np.zeros_like(one) for one in self.linear.multipliers)

    @abstractmethod
    def prepare(self) -> None:
        """Find what the factors need to know of A, in `linear`: at first, and where A has changed."""

    @abstractmethod
    def factors(self, iteration: int, since: int) -> tuple[float, float]:
        """Return a and b for an iteration, counted from 0, so many after the last new beginning; b is 0 at one."""

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """See `Iterated.advance`. What `prepare` finds at the first step is kept for the others."""
        self._prepared = False
        return super().advance(state, contacts, h, substeps)

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        linear, weights = self.linear, self.model.inverse_mass
        pressed = np.zeros((len(step.contacts.friction), *x.shape))
        linear.reset()
        since, smallest = 0, np.inf
        for iteration in range(self.sweeps):
            residual = linear.at(x, step.start, step.h)
            linear.precondition(residual, self._along)
            size = inner(residual, self._along)
            if not np.isfinite(size):
                break
            since += 1
            if iteration == 0 or size > _GROWTH * smallest:
                since, smallest = 0, size
                if iteration > 0 or not self._prepared:
                    self.prepare()
                    self._prepared = True
            smallest = min(smallest, size)
            a, b = self.factors(iteration, since)
            for along, change in zip(self._along, self._change, strict=True):
                change *= b
                change += a * along
            linear.move(x, self._change)
            solve_plane_contacts(x, step.start, weights, step.contacts, step.t0, step.t1, pressed)
            if is_drift_removal_due(iteration + 1, self.sweeps):
                remove_primal_drift(linear, self.model, step, x, pressed)
