"""Moving a cloth on in time among colliders: rounds short enough for the contacts found at their start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.balance import out_of_balance
from vto_pipeline.cloth.build import ClothModel, ClothState
from vto_pipeline.cloth.collision.contacts import Collider, Round, gather, nothing
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.errors import ConfigError, DivergedError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config

FRAME = 1.0 / 60.0
"""Longest round, and the unit in which substeps are counted [s]."""


class StepConfig(Config):
    """How finely time is cut."""

    solver: str = Field("xpbd", description="One of cloth.solvers.SOLVERS")
    substeps: int = Field(20, ge=1, le=10000, description="Steps per 1/60 s")
    sweeps: int = Field(1, ge=1, le=1000, description="Gauss-Seidel sweeps a step")
    travel_mm: float = Field(
        5.0, gt=0, le=100, description="How far cloth may move before contacts are found anew [mm]"
    )
    recovery_speed: float = Field(0.5, gt=0, le=10, description="Speed at which cloth inside a body is led out [m/s]")


class Stepper:
    """A cloth, its colliders and a solver.

    Attributes:
        skin: Distance each vertex keeps from surfaces [m], shape (V,); may be raised between runs.
        substeps: Steps per 1/60 s; may be changed between runs.
        steps: Steps taken so far.
        rounds: Times contacts were found.

    Raises:
        ConfigError: no such solver.
    """

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
        if config.solver not in SOLVERS:
            raise ConfigError(f"solver is {config.solver!r}; allowed: {', '.join(SOLVERS)}")
        self.skin = skin
        self.substeps = config.substeps
        self.steps = 0
        self.rounds = 0
        self._model = model
        self._colliders = colliders
        self._config = config
        self._solver = SOLVERS[config.solver](model, sweeps=config.sweeps, damping=damping, max_speed=max_speed)
        self._contacts = nothing(len(skin))

    def run(self, state: ClothState, seconds: float) -> ClothState:
        """Return the state after so much simulated time [s].

        Raises:
            DivergedError: a position is no longer finite.
        """
        h = FRAME / self.substeps
        left = max(1, round(seconds / h))
        while left > 0:
            count = min(left, self._round_length(state, h))
            state = self._round(state, h, count)
            left -= count
        return state

    def residual(self, state: ClothState) -> float:
        """Return the out-of-balance force; see `balance.out_of_balance`."""
        return out_of_balance(self._model, state.positions, self._contacts)

    def _speed(self, state: ClothState) -> float:
        return float(np.sqrt((state.velocities**2).sum(axis=1).max()))

    def _round_length(self, state: ClothState, h: float) -> int:
        """Return how many steps no vertex travels farther than the contacts are good for."""
        if not self._colliders:
            return self.substeps
        speed = self._speed(state) + float(np.linalg.norm(self._model.gravity)) * h * self.substeps
        return int(np.clip(self._config.travel_mm * 1e-3 / max(speed * h, 1e-12), 1, self.substeps))

    def _round(self, state: ClothState, h: float, count: int) -> ClothState:
        travel = max(self._config.travel_mm * 1e-3, 2.0 * self._speed(state) * h)
        span = Round(state.time, state.time + count * h, travel, self.skin, self._config.recovery_speed)
        self._contacts = gather(self._colliders, state.positions, span)
        after = self._solver.advance(state, self._contacts, h, count)
        self.steps += count
        self.rounds += 1
        if not np.isfinite(after.positions.sum()):
            raise DivergedError(
                f"positions are not finite after {self.steps} steps ({state.time:.2f} s of cloth time)",
                hint="more substeps, or a softer fabric",
            )
        return after
