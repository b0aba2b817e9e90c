"""Everything that resists deformation.

To add one: a file with its data, `project_x` and `add_x_forces`, and its lines below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.bend import Bend, add_bend_forces, project_bend
from vto_pipeline.cloth.constraints.stretch import Stretch, add_stretch_forces, project_stretch


class Constraints(NamedTuple):
    """All constraints of a cloth."""

    stretch: Stretch
    bend: Bend


class Multipliers(NamedTuple):
    """λ of each constraint within one step."""

    stretch: NDArray[np.float64]
    bend: NDArray[np.float64]


def multipliers(constraints: Constraints) -> Multipliers:
    """Return room for the multipliers."""
    return Multipliers(np.zeros((len(constraints.stretch.vertices), 3)), np.zeros(len(constraints.bend.vertices)))


@njit(cache=True)
def reset(lambdas):
    """Begin a step: no constraint has pushed yet."""
    lambdas.stretch[:] = 0.0
    lambdas.bend[:] = 0.0


@njit(cache=True)
def project(x, inverse_mass, constraints, lambdas, h_sq, threaded):
    """Sweep once over all constraints, in place; see `project_stretch`."""
    project_bend(x, inverse_mass, constraints.bend, lambdas.bend, h_sq, threaded)
    project_stretch(x, inverse_mass, constraints.stretch, lambdas.stretch, h_sq, threaded)


@njit(cache=True)
def add_forces(x, constraints, forces):
    """Add the internal forces [N] at positions x, both (V, 3), and return the elastic energy [J]."""
    return add_stretch_forces(x, constraints.stretch, forces) + add_bend_forces(x, constraints.bend, forces)
