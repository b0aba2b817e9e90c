"""Line search of methods that minimise."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.constraints.sweep import add_damping_forces, add_forces
from vto_pipeline.cloth.implicit_step.iterated import ImplicitStep
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.line_search import backtracking_shares, satisfies_armijo

_SHORTEST = 1e-9
_DEARER = 2.0  # than what it pushes: the price of crossing a plane, an exact penalty (Han 1977)


class Merit:
    """Φ = |x - x̃|²_M / 2 + h² E + h D, whose minimum is the implicit step; D is what damping takes at x.

    Args:
        model: The cloth.
        step: The step.
    """

    def __init__(self, model: ClothModel, step: ImplicitStep) -> None:
        self._model = model
        self._step = step
        self._free = (model.inverse_mass > 0.0)[:, None]
        self._damped = any(data.damping > 0.0 for data in model.constraints)
        self._normals, self._heights = step.planes()

    def at(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Return Φ [kg m²] and its gradient [kg m], shape (V, 3), at positions x [m]; zero for held vertices."""
        h, model = self._step.h, self._model
        away = self._free * (x - self._step.target)
        forces, damping = np.zeros_like(x), np.zeros_like(x)
        energy = add_forces(x, model.constraints, forces)
        moved = x - self._step.start
        add_damping_forces(x, moved / h, model.constraints, damping)
        pull = model.mass[:, None] * away
        value = 0.5 * float(np.vdot(away, pull)) + h * h * (energy - 0.5 * float(np.vdot(moved, damping)))
        return value, self._free * (pull - h * h * (forces + damping))

    def share(self, x: FloatArray, move: FloatArray, pushes: FloatArray) -> float:
        """Return the first of 1, ½, ¼ ... for which x + share · move lies low enough, or 0.

        See `satisfies_armijo`. With damping the gradient is not quite that of Φ, and a slope that falls is enough
        (Matthies & Strang 1979).

        Args:
            x: Positions [m], shape (V, 3).
            move: [m], shape (V, 3).
            pushes: Of planes [kg m], shape (S, V): crossing them costs as much more as they push.
        """
        prices = _DEARER * pushes
        value, gradient = self.at(x)
        value += self._crossed(x, prices)
        own_slope = float(np.vdot(gradient, move))
        slope = own_slope + self._crossed(x + move, prices) - self._crossed(x, prices)
        for share in backtracking_shares(_SHORTEST):
            there = x + share * move
            new_value, new_gradient = self.at(there)
            new_value += self._crossed(there, prices)
            new_slope = float(np.vdot(new_gradient, move))
            if satisfies_armijo(value, slope, share, new_value, new_slope, own_slope=own_slope, by_slope=self._damped):
                return share
        return 0.0

    def _crossed(self, x: FloatArray, prices: FloatArray) -> float:
        gaps = np.einsum("svk,vk->sv", self._normals, x) - self._heights
        return float((prices * np.maximum(-gaps, 0.0)).sum())
