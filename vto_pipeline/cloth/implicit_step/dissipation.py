"""What dampers take out of a step of backward Euler."""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.cloth.constraints.sweep import add_damping_forces
from vto_pipeline.model.arrays import FloatArray


def dissipated(
    constraints: tuple[Any, ...], y: FloatArray, move: FloatArray, h: float, drag: FloatArray
) -> tuple[float, float, float]:
    """Return what dampers add to the objective of a step after a share of 0, ½ and 1 of a move: a parabola [J].

    Args:
        constraints: The data of each kind.
        y, move: [m], shape (V, 3).
        h: Step [s].
        drag: Their forces at y [N], shape (V, 3).
    """
    more = np.zeros_like(y)
    add_damping_forces(y, move / h, constraints, more)
    slope, bend = -float(np.vdot(drag, move)), -float(np.vdot(more, move))
    return 0.0, 0.5 * slope + 0.125 * bend, slope + 0.5 * bend
