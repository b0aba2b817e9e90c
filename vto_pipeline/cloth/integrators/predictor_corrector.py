"""Predictor-corrector of second order: Adams-Bashforth predicts, the trapezoidal rule corrects (PECE)."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class PredictorCorrector(Integrator):
    """Predict, evaluate, correct, evaluate (Hairer, Nørsett & Wanner 1993, III.1): two evaluations a step.

    y = (x, v): yₚ = y + h (3/2 y' - 1/2 y'₋), y₁ = y + h/2 (y' + y'(yₚ)). With no step behind it, the predictor is
    Euler's, which makes the first step one of Heun's method and keeps the order.
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
