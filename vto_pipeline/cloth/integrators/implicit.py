"""Implicit one-step methods: each step is a minimum of an incremental potential."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.minimise import conjugate_gradients, newton, newton_step
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class BackwardEuler(Integrator):
    """(M + h²K + h ∂r) Δv = h (f + r) - h² K v: linearly implicit, one linear system a step and no line search.

    Baraff & Witkin 1998; first order.
    """

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = newton_step(step, x, v)
        return new, step.velocity(new)


class BackwardEulerNewton(Integrator):
    """x₁ = x + h v₁, v₁ = v + h a(x₁, v₁), solved to convergence: no energy gained at any h, spin lost; first order."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)


class Ncg(Integrator):
    """Backward Euler by nonlinear conjugate gradients (Frâncu 2015): no linear system is solved; first order."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        step = IncrementalPotential.of_backward_euler(system, x, v, h)
        new = conjugate_gradients(step, x, self.tolerance)
        return new, step.velocity(new)


class ImplicitMidpoint(Integrator):
    """A backward Euler step of h/2 to the middle, mirrored there (Hairer, Lubich & Wanner 2006, II.1.9 and VI.7).

    Symplectic, keeps angular momentum, second order.
    """

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        half = 0.5 * h
        ahead = x + half * v
        middle = newton(IncrementalPotential(system, ahead, half * half, x, half, ahead), x, self.tolerance)
        return 2.0 * middle - x, 2.0 * (middle - x) / half - v


class Newmark(Integrator):
    """x₁ = x + h v + h² ((½ - β) a + β a₁), v₁ = v + h ((1 - γ) a + γ a₁) (Newmark 1959).

    Attributes:
        beta: β > 0. With 1/4, the average acceleration, a linear system neither gains nor loses energy.
        gamma: γ. 1/2 gives second order; above it, high frequencies are damped.
    """

    beta = 0.25
    gamma = 0.5

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        a = system.acceleration(x, v)
        ahead = x + h * v + (0.5 - self.beta) * h * h * a
        square, span = self.beta * h * h, self.beta * h / self.gamma
        known = v + (1.0 - self.gamma) * h * a
        step = IncrementalPotential(system, ahead, square, ahead - span * known, span, ahead)
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)


class Imex(Integrator):
    """Implicit springs, explicit resistance (Eberhardt, Etzmuß & Hauth 2000).

    v* = v + h M⁻¹ r(x, v) explicitly, then one linearly implicit step of the elastic forces and gravity from v*.
    Gravity is constant: explicit and implicit are the same. The matrix has no term of damping or drag, and their
    share sets the limit of stability, h < 2/(α + β ω²).
    """

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        slowed = v + h * system.inverse_mass * system.resistance(x, v)[1]
        step = IncrementalPotential(system, x + h * slowed, h * h, x, np.inf, x)
        new = newton_step(step, x, np.zeros_like(v))
        return new, (new - x) / h
