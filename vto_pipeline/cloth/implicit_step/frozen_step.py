"""One implicit step as a fixed problem, to compare the convergence of methods.

Backward Euler: M (x - x̃) = ∇Cᵀ λ, C + α̃ λ = 0, with x in front of planes that do not rub. The same point is the
minimum of |x - x̃|²_M / 2 + h² E(x), so it needs no multipliers to be recognised.

XPBD drops how gradients turn in the step (see `geometric_stiffness`), so it ends beside the solution: 0.2 µm at h =
1/1200 s on a sheet that falls freely, 20 µm on one that hits a ball. The others end on it at any h.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from vto_pipeline.cloth.collision.contacts import Collider, Contacts, ContactSpan, gather_contacts
from vto_pipeline.cloth.collision.response.step_response import resolve_plane_contacts
from vto_pipeline.cloth.constraints.sweep import add_damping_forces, add_forces
from vto_pipeline.cloth.implicit_step.dual_system import Linearised, inner
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.model.arrays import FloatArray

_RECOVERY = 0.5  # m/s: speed at which cloth inside a collider is led out


@dataclass(frozen=True)
class FrozenStep:
    """A step not yet taken.

    Args:
        model: The cloth. Only its constraints may damp it.
        state: Where it begins.
        contacts: Planes without friction.
        h: Length [s].
    """

    model: ClothModel
    state: ClothState
    contacts: Contacts
    h: float

    @property
    def free_flight(self) -> FloatArray:
        """Return x̃, where vertices would be without constraints [m], shape (V, 3)."""
        moved = self.state.positions + self.h * (self.state.velocities + self.h * self.model.gravity)
        return np.where(self.model.inverse_mass[:, None] > 0.0, moved, self.state.positions)

    def imbalance(self, x: FloatArray) -> float:
        """Return how far x is from solving the step [m], rms over the free vertices; it needs no solution.

        The projected gradient x - P(x - M⁻¹ ∇Φ), with P onto the half-spaces: zero at a minimum and only there.
        """
        pull = self.model.mass[:, None] * (self.free_flight - x)
        forces = np.zeros_like(x)
        add_forces(x, self.model.constraints, forces)
        add_damping_forces(x, (x - self.state.positions) / self.h, self.model.constraints, forces)
        moved = x + self.model.inverse_mass[:, None] * (pull + self.h**2 * forces)
        unused = np.empty_like(x)
        w = self.model.inverse_mass
        resolve_plane_contacts(
            moved, unused, self.state.positions, w, self.contacts, 0.0, 1.0, self.h, np.inf, False, False
        )
        return rms(moved - x, self.model)

    def residuals(self, x: FloatArray, method: DualMethod) -> tuple[float, float]:
        """Return the `constraint` and `energy` of `IterationResiduals` [m] at a method's end [m], shape (V, 3)."""
        linear = Linearised(method.model)
        for one, given in zip(linear.multipliers, method.multipliers, strict=True):
            one[:] = given
        residual = linear.at(x, self.state.positions, self.h)
        along, product = ([np.empty_like(one) for one in residual] for _ in range(2))
        linear.precondition(residual, along)
        linear.apply(along, product)
        mass = float(self.model.mass.sum())
        return float(np.sqrt(inner(residual, along) / mass)), float(np.sqrt(inner(along, product) / mass))


class IterativeMethod(Protocol):
    """What moves a cloth on; see `methods.METHODS`."""

    def __init__(self, model: ClothModel, *, sweeps: int) -> None: ...

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]."""


@runtime_checkable
class DualMethod(Protocol):
    """A method that works on λ."""

    model: ClothModel

    @property
    def multipliers(self) -> tuple[FloatArray, ...]:
        """Return λ of each kind of constraint at the end of the last step, shape (N, B) each."""


@dataclass(frozen=True)
class IterationResiduals:
    """What this many iterations of a method reached.

    Args:
        iterations: Sweeps, or whatever the method counts.
        seconds: Run time of the step, compiled [s].
        distance: From the solution [m], rms over the free vertices.
        imbalance: See `FrozenStep.imbalance` [m].
        constraint: |C + α̃ λ| in the norm of the inverse diagonal blocks D of A, as a length: (rᵀ D⁻¹ r / Σ m)^½ [m].
            None for methods without multipliers.
        energy: (zᵀ A z / Σ m)^½ with z = D⁻¹ r [m], which conjugate residuals work on. None likewise.
    """

    iterations: int
    seconds: float
    distance: float
    imbalance: float
    constraint: float | None = None
    energy: float | None = None


def frozen_step(
    model: ClothModel, state: ClothState, h: float, colliders: Iterable[Collider] = (), skin: float = 0.0
) -> FrozenStep:
    """Return the next step of a cloth.

    Args:
        model: The cloth.
        state: Where it is, say mid-fall.
        h: Length of the step [s].
        colliders: What it may touch; their friction is left out.
        skin: Distance to keep from them [m].
    """
    speed = float(np.linalg.norm(state.velocities, axis=1).max())
    travel = 2.0 * (speed + h * float(np.linalg.norm(model.gravity))) * h
    span = ContactSpan(state.time, state.time + h, travel, np.full(len(state.positions), skin), _RECOVERY)
    contacts = gather_contacts(list(colliders), state.positions, span)
    return FrozenStep(model, state, contacts._replace(friction=np.zeros_like(contacts.friction)), h)


def residual_history(
    method: type[IterativeMethod], step: FrozenStep, iterations: Sequence[int], solution: FloatArray
) -> Iterator[IterationResiduals]:
    """Yield what a method reaches with this many iterations, each run from the start of the step.

    Args:
        method: Its class.
        step: The problem.
        iterations: Numbers to try, such as 1, 2, 4, ... What is prepared once for a model is not counted in the time.
        solution: Of the step [m], shape (V, 3).
    """
    for count in iterations:
        solver = method(step.model, sweeps=count)
        solver.advance(step.state, step.contacts, step.h, 1)
        began = time.perf_counter()
        x = solver.advance(step.state, step.contacts, step.h, 1).positions
        seconds = time.perf_counter() - began
        residuals = step.residuals(x, solver) if isinstance(solver, DualMethod) else (None, None)
        yield IterationResiduals(count, seconds, rms(x - solution, step.model), step.imbalance(x), *residuals)


def rms(change: FloatArray, model: ClothModel) -> float:
    """Return the length of a change of positions, rms over the free vertices."""
    free = model.inverse_mass > 0.0
    return float(np.sqrt((change[free] ** 2).sum(axis=1).mean()))
