"""One implicit step as a minimum: the incremental potential."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.linear.block_matrix import BlockMatrix


@dataclass(frozen=True)
class IncrementalPotential:
    """Φ(y) = |y - x̂|²_M / 2s² + U(y) + τ D((y - o)/τ), stationary where M (y - x̂) = s² (f(y) + r(v)), v = (y - o)/τ.

    Every implicit method here is such a step (Ortiz & Stainier 1999; Martin et al. 2011 for backward Euler); they
    differ in x̂, s, o and τ. D is taken at fixed positions, so that Φ exists with damping as well.

    Args:
        system: The forces.
        inertia: x̂, where the vertices would be without forces [m], shape (V, 3).
        square: s² [s²].
        origin: o, where the velocity would be nothing [m], shape (V, 3).
        span: τ [s]; infinite leaves resistance out.
        around: Where the resistance is taken [m], shape (V, 3).
    """

    system: ForceSystem
    inertia: FloatArray
    square: float
    origin: FloatArray
    span: float
    around: FloatArray

    @classmethod
    def of_backward_euler(cls, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> IncrementalPotential:
        """Return the step x₁ = x + h v₁, v₁ = v + h M⁻¹ (f(x₁) + r(v₁))."""
        return cls(system, x + h * v, h * h, x, h, x)

    def velocity(self, y: FloatArray) -> FloatArray:
        """Return (y - o)/τ [m/s]."""
        return (y - self.origin) / self.span

    @property
    def resisted(self) -> bool:
        """Whether there is a D."""
        return self.system.resists and bool(np.isfinite(self.span))

    def at(self, y: FloatArray) -> tuple[float, FloatArray]:
        """Return Φ(y) [J] and its gradient [N], shape (V, 3); zero for held vertices."""
        system = self.system
        away = system.free * (y - self.inertia)
        pull = system.mass * away / self.square
        energy, forces = system.potential(y)
        value, gradient = energy + 0.5 * float(np.vdot(away, pull)), pull - forces
        if self.resisted:
            power, resistance = system.resistance(self.around, self.velocity(y))
            value += self.span * power
            gradient -= resistance
        return value, system.free * gradient

    def hessian(self, y: FloatArray, v: FloatArray) -> BlockMatrix:
        """Return the positive definite part of Φ's second derivative, at a velocity; the next call overwrites it."""
        return self.system.matrix(y, v, 1.0 / self.square, 1.0 / self.span)
