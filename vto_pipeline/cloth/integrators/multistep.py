"""Methods that remember the step before, in y = (x, v)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.minimise import newton
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class PredictorCorrector(Integrator):
    """Adams-Bashforth predicts, the trapezoidal rule corrects (PECE): second order, two evaluations a step.

    yₚ = y + h (3/2 y' - 1/2 y'₋), y₁ = y + h/2 (y' + y'(yₚ)) (Hairer, Nørsett & Wanner 1993, III.1). With no step
    behind it, the predictor is Euler's, which makes the first step one of Heun's method and keeps the order.
    """

    _before: tuple[FloatArray, FloatArray] | None = None

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        a = system.acceleration(x, v)
        v_before, a_before = self._before or (v, a)
        self._before = v, a
        v_predicted = v + h * (1.5 * a - 0.5 * a_before)
        a_predicted = system.acceleration(x + h * (1.5 * v - 0.5 * v_before), v_predicted)
        return x + 0.5 * h * (v + v_predicted), v + 0.5 * h * (a + a_predicted)

    def restart(self) -> None:
        """See `Integrator.restart`."""
        self._before = None


class Bdf2(Integrator):
    """Backward differentiation (Gear 1971; for cloth Choi & Ko 2002): y₁ = 4/3 y - 1/3 y₋ + 2/3 h y'₁, second order.

    It loses less energy than backward Euler and stays as stable. With no step behind it, the first is backward
    Euler's: its error of h² enters once and keeps the order.
    """

    _before: tuple[FloatArray, FloatArray] | None = None

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        if self._before is None:
            step = IncrementalPotential.of_backward_euler(system, x, v, h)
        else:
            x_before, v_before = self._before
            span = 2.0 / 3.0 * h
            origin = (4.0 * x - x_before) / 3.0
            ahead = origin + span * (4.0 * v - v_before) / 3.0
            step = IncrementalPotential(system, ahead, span * span, origin, span, ahead)
        self._before = x, v
        new = newton(step, x, self.tolerance)
        return new, step.velocity(new)

    def restart(self) -> None:
        """See `Integrator.restart`."""
        self._before = None
