"""Time stepping among colliders, in spans short enough for the contacts found at their start."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import (
    Collider,
    ContactSpan,
    empty_contacts,
    gather_contacts,
    without_friction,
)
from vto_pipeline.cloth.collision.response.active_set import LYING, ActiveSet, active_set, no_contacts
from vto_pipeline.cloth.collision.response.penalty import FREQUENCY, Penalty
from vto_pipeline.cloth.collision.response.projected_gauss_seidel import separate_pairs
from vto_pipeline.cloth.collision.self_collision.pairs import no_pairs
from vto_pipeline.cloth.collision.self_collision.self_contact import SelfContact
from vto_pipeline.cloth.collision.shapes.moving import Moving
from vto_pipeline.cloth.dynamics.methods import FRAME, METHODS, Method, MethodChoice, choose_method
from vto_pipeline.cloth.dynamics.residual import relative_residual
from vto_pipeline.cloth.implicit_step.rest_ahead import RestAhead
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.solvers.newton import Limits, Newton
from vto_pipeline.errors import ConfigError, DivergedError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config

_HARD = 0.2  # of the distance layers keep: how much of it is not given way by contact forces
_OUT_OF_BOUNDS = 1e9  # m
_TOO_FAST = 1e6  # m/s: cloth that blows up may be kept from passing through itself, and so in its place
_WHOLE = 1e-6  # steps: what rounding may add to a whole number of them


class StepConfig(Config):
    """Settings of the time stepping."""

    solver: str | None = Field(None, description="Name of the method; by default chosen from the scene")
    substeps: float | None = Field(
        None, ge=0.1, le=10000, description="Steps per 1/60 s, below 1 for longer steps; by default the method's own"
    )
    sweeps: int | None = Field(None, ge=1, le=100000, description="Iterations per step; by default the method's own")
    travel_mm: float = Field(
        5.0, gt=0, le=100, description="How far cloth may move before contacts are searched again [mm]"
    )
    self_collision: bool = Field(True, description="Whether cloth is kept from passing through itself")
    body_features: bool = Field(
        False,
        description="Whether body corners and edges push cloth between its vertices; requires self_collision. "
        "Needed where the body is sharper than the cloth is fine. Slower, and later to rest",
    )
    contact_forces: bool = Field(
        False,
        description="Whether contacts are penalty forces, for comparing force-based integrators; cloth sinks in. "
        "By default contacts are constraints",
    )
    air_drag: float = Field(
        0.0,
        ge=0,
        le=10,
        description="Drag coefficient of a triangle along its normal; a plate has 1.2. For integrators of forces",
    )
    air_density: float = Field(1.2, ge=0, le=2000, description="Density of the air, for its drag [kg/m³]")
    recovery_speed: float = Field(0.5, gt=0, le=10, description="Speed at which cloth inside a body is moved out [m/s]")


class Pins(NamedTuple):
    """Held vertices that move along a path.

    Args:
        vertices: Which, shape (P,).
        path: Where they are at a time [s]: [m], shape (P, 3).
    """

    vertices: NDArray[np.int64]
    path: Callable[[float], FloatArray]


class Stepper:
    """A cloth, its colliders and a solver.

    Attributes:
        choice: The method taken, and why; after `prepare`.
        skin: Distance each vertex keeps from surfaces [m], shape (V,); may be raised between runs.
        loose: Vertices that slide on surfaces without friction, shape (V,); none, but may be changed between runs.
        substeps: Steps per 1/60 s; after `prepare`, and may be changed between runs.
        deadline: `time.perf_counter` by which runs are to be done; may be set between runs.
        steps: Steps taken so far.
        contact_spans: Times contacts were found.
        self_contact: What keeps the cloth from itself, None if nothing does.
    """

    choice: MethodChoice
    substeps: float

    def __init__(
        self,
        model: ClothModel,
        colliders: Sequence[Collider],
        skin: FloatArray,
        config: StepConfig,
        *,
        damping: float = 0.0,
        max_speed: float = np.inf,
        pins: Pins | None = None,
        crossed: NDArray[np.bool_] | None = None,
        force_all: bool = False,
    ) -> None:
        self.skin = skin
        self.loose = np.zeros(len(skin), np.bool_)
        self.deadline = np.inf
        self.steps = 0
        self.contact_spans = 0
        self._last_took = 0.0
        self._model = model
        self._colliders = colliders
        self._config = config
        self._damping = damping
        self._max_speed = max_speed
        self._method: Method | None = None
        self._pins = pins
        self._contacts = empty_contacts(len(skin))
        self.self_contact: SelfContact | None = None
        if config.self_collision and len(model.faces) > 0:
            self.self_contact = SelfContact(
                model.faces,
                model.reach,
                model.friction,
                bodies=[one for one in colliders if config.body_features and isinstance(one, BodyCollider)],
                at_once=config.contact_forces,
                crossed=crossed,
                force_all=force_all,
            )

    def prepare(self, positions: FloatArray) -> None:
        """Choose the method, and let it make what it needs, for a cloth that starts here [m], shape (V, 3). Once.

        Raises:
            ConfigError: no such method, or none that knows forces where contacts are to be forces.
        """
        if self._method is not None:
            return
        config = self._config
        besides = FREQUENCY if config.contact_forces else 0.0
        self.choice = choose_method(self._model, positions, config.solver, config.substeps, config.sweeps, besides)
        self.substeps = self.choice.substeps
        self._method = METHODS[self.choice.method](
            self._model, sweeps=self.choice.sweeps, damping=self._damping, max_speed=self._max_speed
        )
        if isinstance(self._method, Integrator):
            self._method.system.air = 0.5 * config.air_density * config.air_drag
            self._method.system.penalty = Penalty(self._model) if config.contact_forces else None
        elif config.contact_forces or config.air_drag > 0.0:
            raise ConfigError(
                f"{'contact_forces' if config.contact_forces else 'air_drag'} is set, and solver "
                f"{self.choice.method!r} knows no forces; allowed: {', '.join(INTEGRATORS)}"
            )
        if isinstance(self._method, Newton | Integrator):
            self._method.self_contact = self.self_contact

    def run(self, state: ClothState, seconds: float) -> ClothState:
        """Return the state after so much simulated time [s]; earlier where it is `out_of_time`, or a step is not taken.

        Raises:
            DivergedError: a position is no longer finite.
        """
        self.prepare(state.positions)
        h = FRAME / self.substeps
        left = ceil(seconds / h - _WHOLE)
        if abs(left * h - seconds) > _WHOLE * h:  # not a whole number of steps: they are a little shorter
            h = seconds / left
        while left > 0 and not self.out_of_time:
            began = time.perf_counter()
            count, taken = min(left, self._steps_per_span(state, h)), self.steps
            state = self._advance_span(state, h, count)
            left -= count
            self._last_took = time.perf_counter() - began
            if self.steps < taken + count:
                break
        return state

    @property
    def out_of_time(self) -> bool:
        """Whether more steps would not be done by the deadline, if they take as long as the last."""
        return time.perf_counter() + self._last_took > self.deadline

    def residual(self, state: ClothState) -> float:
        """Return the residual force; see `residual.relative_residual`."""
        return relative_residual(self._model, state.positions, self._touched(state, LYING))

    def _touched(self, state: ClothState, lying: float) -> ActiveSet:
        """Return the contacts where the cloth is; what is nearer than `lying` [m] pushes, beside what did."""
        x, still = state.positions, np.zeros_like(state.positions)
        pairs = no_pairs() if self.self_contact is None else self.self_contact.find_pairs(x, x, FRAME)
        return active_set(
            self._contacts, pairs, 0.0, 1.0, self._model.inverse_mass, x, still, self.contact_memory, lying
        )

    @property
    def faces(self) -> NDArray[np.int32]:
        """Triangles of the cloth, shape (F, 3)."""
        return self._model.faces

    @property
    def contact_memory(self) -> ActiveSet:
        """What is known of the contacts from the last step, as far as the method keeps it; may be set back to it."""
        return self._method.active if isinstance(self._method, Newton) else no_contacts(0)

    @contact_memory.setter
    def contact_memory(self, before: ActiveSet) -> None:
        if isinstance(self._method, Newton):
            self._method.active = before

    @property
    def has_exact_rest(self) -> bool:
        """Whether the state of rest does not depend on the length of steps; after `prepare`."""
        return getattr(self._method, "has_exact_rest", True)

    @property
    def pushing_contacts(self) -> int:
        """How many contacts pushed in the last step, as far as the method counts them."""
        return getattr(self._method, "pushing_contacts", 0)

    @property
    def step(self) -> float:
        """Length of a step [s]."""
        return FRAME / self.substeps

    @property
    def may_lengthen_steps(self) -> bool:
        """Whether steps may be longer than usual: none were asked for, and only the cloth moves; after `prepare`."""
        if not isinstance(self._method, Newton) or self._config.substeps is not None or self._pins is not None:
            return False
        tangled = self.self_contact is not None and self.self_contact.tangled
        return not tangled and not any(_moves(collider) for collider in self._colliders)

    def driven(self, before: ClothState, after: ClothState) -> FloatArray:
        """Return by how much what is not damping changed the speed of each vertex in a step [m/s], shape (V,)."""
        kept = exp(-self._damping * (after.time - before.time))
        return np.asarray(np.linalg.norm(after.velocities - kept * before.velocities, axis=1))

    @property
    def free_fall(self) -> float:
        """Acceleration of what falls freely [m/s²]."""
        return float(np.linalg.norm(self._model.gravity))

    @property
    def can_use_exact_stiffness(self) -> bool:
        """Whether the method can use the exact stiffness; after `prepare`."""
        return isinstance(self._method, Newton) and self._method.can_use_exact_stiffness

    def use_exact_stiffness(self, on: bool) -> None:
        """Let steps use the exact stiffness from now on, or no longer; after `prepare`.

        They take one iteration each: near rest it is the end that matters, not the way there. A run ends before a step
        whose system is not positive definite.
        """
        if isinstance(self._method, Newton):
            self._method.exact = on
            self._method.limits = Limits(iterations=1) if on else Limits()

    def rest_ahead(self, state: ClothState, seconds: float) -> RestAhead | None:
        """Return where the cloth would come to rest within that time [s], were its contacts to stay.

        Returns:
            None where that is not known.
        """
        if not isinstance(self._method, Newton):
            return None
        return self._method.rest_ahead(state, self._touched(state, 0.0), seconds)

    def accelerate(self, on: bool) -> None:
        """Let the method carry moves on from now on, where only the end matters, or no longer; after `prepare`."""
        if isinstance(self._method, Newton):
            self._method.accelerated = on

    @property
    def was_positive_definite(self) -> bool:
        """Whether the last step did throughout: at no point was the cloth about to buckle."""
        return isinstance(self._method, Newton) and self._method.definite

    def _speed(self, state: ClothState) -> float:
        return float(np.abs(state.velocities).max() * np.sqrt(3.0))  # a bound, which does not overflow

    def _steps_per_span(self, state: ClothState, h: float) -> int:
        """Return how many steps no vertex travels farther than the contacts are good for."""
        most = 1 if self._pins is not None else max(1, round(self.substeps))
        if not isinstance(self._method, Newton) and self._is_near_itself(state, h * most):
            most = 1  # those that know no contacts of the cloth with itself have them put right after each step
        if not self._colliders:
            return most
        speed = self._speed(state) + float(np.linalg.norm(self._model.gravity)) * h * most
        return int(np.clip(self._config.travel_mm * 1e-3 / max(speed * h, 1e-12), 1, most))

    def _advance_span(self, state: ClothState, h: float, count: int) -> ClothState:
        travel = max(self._config.travel_mm * 1e-3, 2.0 * self._speed(state) * h)
        move = count * h * state.velocities
        recovery = np.inf if self._config.contact_forces else self._config.recovery_speed
        span = ContactSpan(state.time, state.time + count * h, travel, self.skin, recovery, move)
        self._contacts = gather_contacts(self._colliders, state.positions, span)
        if self.loose.any():
            self._contacts = without_friction(self._contacts, self.loose)
        assert self._method is not None  # `run` prepared it
        before = state
        if self._pins is not None:
            state = self._with_pins_moved(state, self._pins, count * h)
        after = self._method.advance(state, self._contacts, h, count)
        self.steps += round((after.time - before.time) / h)
        self.contact_spans += 1
        self._refuse_divergence(after)
        if self.self_contact is not None and not isinstance(self._method, Newton):
            after = self._resolve_self_contacts(before, after, h * count)
        return after

    def _refuse_divergence(self, state: ClothState) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            farthest = np.abs(state.positions).max(initial=0.0)
            fastest = np.abs(state.velocities).max(initial=0.0)
        if not (farthest < _OUT_OF_BOUNDS and fastest < _TOO_FAST):
            raise DivergedError(
                f"positions are not finite, or out of all bounds, after {self.steps} steps "
                f"({state.time:.2f} s of cloth time)",
                hint="more substeps, or a softer fabric",
            )

    def _with_pins_moved(self, state: ClothState, pins: Pins, seconds: float) -> ClothState:
        """Return the state with the pins under way to where their path has them after this many seconds."""
        positions, velocities = state.positions.copy(), state.velocities.copy()
        there = pins.path(state.time + seconds)
        velocities[pins.vertices] = (there - positions[pins.vertices]) / seconds
        if not isinstance(self._method, Newton):  # the others hold what is held where it is
            positions[pins.vertices] = there
        return replace(state, positions=positions, velocities=velocities)

    def _is_near_itself(self, state: ClothState, seconds: float) -> bool:
        """Return whether, by its velocities, the cloth comes near itself in this many seconds."""
        if self.self_contact is None:
            return False
        self.self_contact.set_time_span(state.time, state.time + seconds)
        drift = seconds * state.velocities
        end = state.positions + drift + 0.5 * seconds**2 * self._model.gravity
        return len(self.self_contact.find_pairs(state.positions, end, seconds, drift).key) > 0

    def _resolve_self_contacts(self, state: ClothState, after: ClothState, seconds: float) -> ClothState:
        """Resolve self-contacts after a step of a method that ignores them."""
        assert self.self_contact is not None
        positions = after.positions.copy()
        self.self_contact.set_time_span(state.time, state.time + seconds)
        pairs = self.self_contact.find_pairs(state.positions, positions, seconds)
        if self._config.contact_forces:  # a spring bears only so much
            pairs = pairs._replace(gap=_HARD * pairs.gap)
        separate_pairs(pairs, self._model.inverse_mass, state.positions, positions)
        positions, _ = self.self_contact.collision_free(state.positions, positions)
        velocities = after.velocities + (positions - after.positions) / seconds
        return replace(after, positions=positions, velocities=velocities)


def _moves(collider: Collider) -> bool:
    return isinstance(collider, Moving) or (isinstance(collider, BodyCollider) and collider.moves)
