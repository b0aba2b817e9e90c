"""Moving a cloth on in time among colliders: rounds short enough for the contacts found at their start."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.balance import out_of_balance
from vto_pipeline.cloth.build import ClothModel, ClothState
from vto_pipeline.cloth.collision.contacts import Collider, Round, gather, nothing
from vto_pipeline.cloth.methods import FRAME, METHODS, Choice, Method, choose
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config

_WHOLE = 1e-6  # steps: what rounding may add to a whole number of them


class StepConfig(Config):
    """How finely time is cut."""

    solver: str | None = Field(None, description="One of cloth.methods.METHODS; by default chosen by the scene")
    substeps: float | None = Field(
        None, ge=0.1, le=10000, description="Steps per 1/60 s, under 1 for longer ones; by default the method's own"
    )
    sweeps: int | None = Field(None, ge=1, le=100000, description="Iterations a step; by default the method's own")
    travel_mm: float = Field(
        5.0, gt=0, le=100, description="How far cloth may move before contacts are found anew [mm]"
    )
    recovery_speed: float = Field(0.5, gt=0, le=10, description="Speed at which cloth inside a body is led out [m/s]")


class Stepper:
    """A cloth, its colliders and a solver.

    Attributes:
        choice: The method taken, and why; after `prepare`.
        skin: Distance each vertex keeps from surfaces [m], shape (V,); may be raised between runs.
        substeps: Steps per 1/60 s; after `prepare`, and may be changed between runs.
        steps: Steps taken so far.
        rounds: Times contacts were found.
    """

    choice: Choice
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
    ) -> None:
        self.skin = skin
        self.steps = 0
        self.rounds = 0
        self._model = model
        self._colliders = colliders
        self._config = config
        self._damping = damping
        self._max_speed = max_speed
        self._method: Method | None = None
        self._contacts = nothing(len(skin))

    def prepare(self, positions: FloatArray) -> None:
        """Choose the method, and let it make what it needs, for a cloth that starts here [m], shape (V, 3). Once.

        Raises:
            ConfigError: no such method.
        """
        if self._method is not None:
            return
        config = self._config
        self.choice = choose(self._model, positions, config.solver, config.substeps, config.sweeps)
        self.substeps = self.choice.substeps
        self._method = METHODS[self.choice.method](
            self._model, sweeps=self.choice.sweeps, damping=self._damping, max_speed=self._max_speed
        )

    def run(self, state: ClothState, seconds: float) -> ClothState:
        """Return the state after so much simulated time [s].

        Raises:
            DivergedError: a position is no longer finite.
        """
        self.prepare(state.positions)
        h = FRAME / self.substeps
        left = ceil(seconds / h - _WHOLE)
        if abs(left * h - seconds) > _WHOLE * h:  # not a whole number of steps: they are a little shorter
            h = seconds / left
        while left > 0:
            count = min(left, self._round_length(state, h))
            state = self._round(state, h, count)
            left -= count
        return state

    def residual(self, state: ClothState) -> float:
        """Return the out-of-balance force; see `balance.out_of_balance`."""
        return out_of_balance(self._model, state.positions, self._contacts)

    @property
    def rests_exactly(self) -> bool:
        """Whether the state of rest does not depend on the length of steps; after `prepare`."""
        return getattr(self._method, "rests_exactly", True)

    def _speed(self, state: ClothState) -> float:
        return float(np.abs(state.velocities).max() * np.sqrt(3.0))  # a bound, which does not overflow

    def _round_length(self, state: ClothState, h: float) -> int:
        """Return how many steps no vertex travels farther than the contacts are good for."""
        most = max(1, round(self.substeps))
        if not self._colliders:
            return most
        speed = self._speed(state) + float(np.linalg.norm(self._model.gravity)) * h * most
        return int(np.clip(self._config.travel_mm * 1e-3 / max(speed * h, 1e-12), 1, most))

    def _round(self, state: ClothState, h: float, count: int) -> ClothState:
        travel = max(self._config.travel_mm * 1e-3, 2.0 * self._speed(state) * h)
        span = Round(state.time, state.time + count * h, travel, self.skin, self._config.recovery_speed)
        self._contacts = gather(self._colliders, state.positions, span)
        assert self._method is not None  # `run` prepared it
        after = self._method.advance(state, self._contacts, h, count)
        self.steps += count
        self.rounds += 1
        if not np.isfinite(after.positions).all() or not np.isfinite(after.velocities).all():
            raise DivergedError(
                f"positions are not finite after {self.steps} steps ({state.time:.2f} s of cloth time)",
                hint="more substeps, or a softer fabric",
            )
        return after
