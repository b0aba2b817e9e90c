"""Static equilibrium: Newton's method on the potential energy, with a sparse direct solve.

Far from rest the stiffness is the positive semidefinite one of an implicit step; mass times a falling rate is added,
so that the path is that of a damped fall (pseudo-transient continuation; Kelley & Keyes 1998). A line search makes the
energy fall in each step. Near rest the exact stiffness takes over, and the error falls quadratically. Where that one
is indefinite (before a fold, say), so much mass is added that Cholesky's factorisation succeeds. So the result is a
minimum, never a saddle.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.settings import Config
from vto_pipeline.numerics.line_search import backtracking_shares
from vto_pipeline.numerics.linear.direct import DirectSolver
from vto_pipeline.units import GRAVITY

_SHORTEST = 1e-9  # share of a step
_DESCENT = 1e-4  # Armijo's share of the predicted fall
_ROUNDING = 1e-12  # of load times size: a smaller change of energy is lost in rounding


class EquilibriumConfig(Config):
    """How far and how long Newton goes."""

    tolerance: float = Field(default=1e-8, gt=0, lt=1, description="Residual force at rest, as a share of the load")
    iterations: int = Field(default=300, ge=1, le=100000, description="Newton steps, at most")
    exact_below: float = Field(
        default=1e-2,
        ge=0,
        le=1,
        description="Residual force below which the exact stiffness is used, as a share of the load",
    )


@dataclass(frozen=True)
class Equilibrium:
    """A cloth at rest.

    Args:
        positions: [m], shape (V, 3).
        residuals: Root of the sum of the squared forces before each step and at the end, as a share of the whole load.
        exact: How many of the steps used the exact stiffness.
        seconds: Wall time [s].
    """

    positions: FloatArray
    residuals: tuple[float, ...]
    exact: int
    seconds: float

    @property
    def iterations(self) -> int:
        """Newton steps."""
        return len(self.residuals) - 1


def equilibrium(
    model: ClothModel, start: FloatArray, config: EquilibriumConfig | None = None, *, load: FloatArray | None = None
) -> Equilibrium:
    """Return a stable equilibrium of a cloth without contacts, the one downhill of where it starts.

    Args:
        model: The cloth.
        start: Positions [m], shape (V, 3); held vertices are held there.
        config: Limits.
        load: Forces beside gravity [N], shape (V, 3).

    Raises:
        DivergedError: no equilibrium within the iterations.
    """
    return _Search(model, config or EquilibriumConfig(), load).run(start)


class _Search:
    def __init__(self, model: ClothModel, config: EquilibriumConfig, load: FloatArray | None) -> None:
        self._model = model
        self._config = config
        self._free = (model.inverse_mass > 0.0)[:, None]
        self._external = model.mass[:, None] * model.gravity + (0.0 if load is None else load)
        self._stiffness = Stiffness(model)
        self._solver = DirectSolver(self._stiffness.matrix)
        self._mass = np.where(self._free, model.mass[:, None], 0.0)[:, :, None] * np.eye(3)
        pulled = float(np.linalg.norm(self._free * self._external, axis=1).sum())
        self._scale = pulled if pulled > 0.0 else GRAVITY * float(model.mass[self._free[:, 0]].sum())
        self._rate = GRAVITY / model.edge_length

    def run(self, start: FloatArray) -> Equilibrium:
        began = time.perf_counter()
        x, exact = np.array(start, dtype=np.float64), 0
        energy, forces = self._at(x)
        residuals = [self._residual(forces)]
        rate = self._rate
        while residuals[-1] > self._config.tolerance:
            if len(residuals) > self._config.iterations:
                raise DivergedError(
                    f"no equilibrium after {self._config.iterations} Newton steps; "
                    f"out-of-balance force {residuals[-1]:.1e} of the load",
                    hint="a start nearer to rest, or more iterations",
                )
            near = residuals[-1] < self._config.exact_below
            exact += near
            step = self._direction(x, forces, rate, near)
            length, energy, forces = self._search(x, step, energy, forces)
            x += length * step
            rate *= 0.25 if length == 1.0 else 2.0
            residuals.append(self._residual(forces))
        return Equilibrium(x, tuple(residuals), exact, time.perf_counter() - began)

    def _at(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return the potential energy [J] and the forces [N], shape (V, 3); zero for held vertices."""
        forces = self._external.copy()
        energy = add_forces(x, self._model.constraints, forces)
        return float(energy - np.vdot(self._external, x)), self._free * forces

    def _residual(self, forces: FloatArray) -> float:
        return float(np.linalg.norm(forces)) / self._scale

    def _direction(self, x: FloatArray, forces: FloatArray, rate: float, exact: bool) -> FloatArray:
        """Return the Newton step [m], shape (V, 3); zero for held vertices."""
        shift = 0.0 if exact else rate
        matrix = self._stiffness.assemble_exact(x) if exact else self._stiffness.assemble(x, shift)
        while not self._solver.factorise(matrix.blocks):
            more = max(3.0 * shift, rate)
            matrix.blocks[matrix.diagonal] += more * self._mass
            shift += more
        return self._solver.solve(forces)

    def _search(
        self, x: FloatArray, step: FloatArray, energy: float, forces: FloatArray
    ) -> tuple[float, float, FloatArray]:
        """Return the first of 1, ½, ¼, ... that lowers the energy or, where rounding hides that, the forces."""
        slope = float(np.vdot(forces, step))
        for length in backtracking_shares(_SHORTEST):
            after, pulls = self._at(x + length * step)
            lower = after <= energy - _DESCENT * length * slope
            hidden = length * slope < _ROUNDING * self._scale * float(np.abs(x).max())
            if lower or (hidden and np.linalg.norm(pulls) < np.linalg.norm(forces)):
                return length, after, pulls
        raise DivergedError(
            f"no step lowers the energy; out-of-balance force {self._residual(forces):.1e} of the load",
            hint="the tolerance may be below what rounding allows",
        )
