"""Conjugate residuals on the multipliers of a whole step."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.implicit_step.dual_system import inner
from vto_pipeline.cloth.implicit_step.geometric_stiffness import is_drift_removal_due, remove_primal_drift
from vto_pipeline.cloth.implicit_step.iterated import DualIterated, ImplicitStep
from vto_pipeline.cloth.implicit_step.plane_multiplier import solve_plane_contacts
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray


class ConjugateResidual(DualIterated):
    """The minimum residual method of Stiefel 1955 on A Δλ = r, linearised anew in each iteration.

    Frâncu & Moldoveanu 2014: with z = D⁻¹ r and q = A d, d ← z + β d by β = min(1, (zᵀ A z)' / zᵀ A z), and the step
    α = zᵀ q / qᵀ D⁻¹ q that makes rᵀ D⁻¹ r smallest. On a linear problem the residual falls in every iteration; with
    the block diagonal D of A, angles and lengths may stand beside each other in it. Where it has grown, gradients have
    turned too far for the old direction, and β is 0.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def __init__(self, model: ClothModel, *, sweeps: int = 1, damping: float = 0.0, max_speed: float = np.inf) -> None:
        super().__init__(model, sweeps=sweeps, damping=damping, max_speed=max_speed)
        self._along, self._product, self._scaled = (
            tuple(np.zeros_like(one) for one in self.linear.multipliers) for _ in range(3)
        )
        self._direction = tuple(np.zeros_like(one) for one in self.linear.multipliers)

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        linear = self.linear
        linear.reset()
        pressed = np.zeros((len(step.contacts.friction), *x.shape))
        before = size_before = np.inf
        for iteration in range(self.sweeps):
            residual = linear.at(x, step.start, step.h)
            linear.precondition(residual, self._along)
            linear.apply(self._along, self._product)
            energy = inner(self._along, self._product)
            if energy == 0.0 or not np.isfinite(energy):
                break
            size = inner(residual, self._along)
            beta = min(1.0, energy / before) if size < size_before else 0.0
            before, size_before = energy, size
            for direction, along in zip(self._direction, self._along, strict=True):
                direction *= beta
                direction += along
            linear.apply(self._direction, self._product)
            linear.precondition(self._product, self._scaled)
            share = inner(self._along, self._product) / inner(self._product, self._scaled)
            for scaled, direction in zip(self._scaled, self._direction, strict=True):
                np.multiply(direction, share, out=scaled)
            linear.move(x, self._scaled)
            solve_plane_contacts(x, step.start, self.model.inverse_mass, step.contacts, step.t0, step.t1, pressed)
            if is_drift_removal_due(iteration + 1, self.sweeps):
                remove_primal_drift(linear, self.model, step, x, pressed)
