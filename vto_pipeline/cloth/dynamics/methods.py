"""The table of solvers and integrators, and the choice among them by scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil
from typing import Protocol

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts
from vto_pipeline.cloth.constraints.bending.hinge_moments import by_hinges
from vto_pipeline.cloth.constraints.rigid import rigid_kind
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.model.build import ClothModel, ClothState
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.arrays import FloatArray


class Method(Protocol):
    """A solver or integrator of one cloth."""

    def advance(self, state: ClothState, contacts: Contacts, h: float, substeps: int) -> ClothState:
        """Return the state after `substeps` steps of h [s]. The contacts hold for their whole span."""


METHODS: dict[str, Callable[..., Method]] = {**SOLVERS, **INTEGRATORS}
"""Name -> class, made by `METHODS[name](model, sweeps=, damping=, max_speed=)` and run by its `advance`."""

FRAME = 1.0 / 60.0
"""The span of time in which steps are counted [s]."""

_SAFE = 0.8  # hω of an explicit method by default: under the limits of those that have one, from 1.3 to 2.8
_EXPLICIT = {
    "explicit_euler": _SAFE,  # without damping it has none
    "symplectic_euler": _SAFE,
    "verlet": _SAFE,
    "leapfrog": _SAFE,
    "rk2": 0.2,  # nor has this: amplitudes grow by (hω)⁴/8 a step
    "rk4": _SAFE,
    "predictor_corrector": _SAFE,
}
_MOST = 10000  # steps a frame

_USUAL = {"newton": (1, 1), "xpbd": (20, 1), "pbd_soft": (20, 1)}
_ITERATED = (2, 20)  # steps a frame and iterations of the other solvers
_IMPLICIT = (2, 1)


@dataclass(frozen=True)
class MethodChoice:
    """A method and its budget.

    Args:
        method: One of METHODS.
        substeps: Steps per 1/60 s.
        sweeps: Iterations a step.
        reason: Why.
    """

    method: str
    substeps: float
    sweeps: int
    reason: str


def choose_method(
    model: ClothModel,
    positions: FloatArray,
    method: str | None,
    substeps: float | None,
    sweeps: int | None,
    frequency: float = 0.0,
) -> MethodChoice:
    """Return the method as chosen by the user, and the rest by the scene.

    Args:
        model: The cloth.
        positions: Where it starts [m], shape (V, 3).
        method, substeps, sweeps: What was asked for; None where the scene decides.
        frequency: The highest of what is not part of the model [rad/s].

    Raises:
        ConfigError: no such method.
    """
    if method is None:
        method, reason = _by_scene(model, positions)
    elif method in METHODS:
        reason = "chosen by the user"
    else:
        raise ConfigError(f"solver is {method!r}; allowed: {', '.join(METHODS)}")
    usual = _usual(method, model, positions, frequency)
    return MethodChoice(method, substeps or usual[0], sweeps or usual[1], reason)


def _by_scene(model: ClothModel, positions: FloatArray) -> tuple[str, str]:
    rigid = rigid_kind(model.constraints, positions)
    if rigid is not None:
        return "xpbd", f"{rigid} constraints are rigid, and only multipliers can hold them"
    highest = highest_frequency(replace(model, constraints=by_hinges(model.constraints)), positions)  # to be told only
    explicit = ceil(FRAME * highest / _SAFE)
    return "newton", (
        f"large implicit steps: {len(positions)} vertices, and the stiffest of their motions would cost an explicit "
        f"method {explicit} steps per 1/60 s"
    )


def _usual(method: str, model: ClothModel, positions: FloatArray, frequency: float) -> tuple[int, int]:
    if method in _USUAL:
        return _USUAL[method]
    if method in _EXPLICIT:
        steps = FRAME * max(highest_frequency(model, positions), frequency) / _EXPLICIT[method]
        return max(1, ceil(min(steps, _MOST))), 1
    return _ITERATED if method in SOLVERS else _IMPLICIT


def highest_frequency(model: ClothModel, positions: FloatArray) -> float:
    """Return a bound of the highest frequency ω of a cloth [rad/s]: Gershgorin's on M^-½ K M^-½.

    Args:
        model: The cloth; with a rigid constraint the bound is infinite.
        positions: Where it is [m], shape (V, 3).
    """
    if rigid_kind(model.constraints, positions) is not None:
        return np.inf
    matrix = Stiffness(model).assemble(positions)
    scale = np.sqrt(model.inverse_mass)
    row = np.repeat(np.arange(len(scale)), np.diff(matrix.starts))
    parts = np.linalg.norm(matrix.blocks, axis=(1, 2)) * scale[row] * scale[matrix.columns]
    return float(np.sqrt(np.bincount(row, parts, minlength=len(scale)).max(initial=0.0)))
