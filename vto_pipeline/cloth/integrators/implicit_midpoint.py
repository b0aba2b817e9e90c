"""The implicit midpoint rule: symplectic, keeps angular momentum, second order."""

from __future__ import annotations

from vto_pipeline.cloth.integrators.integrator import Integrator
from vto_pipeline.cloth.integrators.newton import newton
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.model.arrays import FloatArray


class ImplicitMidpoint(Integrator):
    """A backward Euler step of h/2 to the middle, mirrored there (Hairer, Lubich & Wanner 2006, II.1.9 and VI.7)."""

    def step(self, system: ForceSystem, x: FloatArray, v: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """See `Integrator.step`."""
        half = 0.5 * h
        ahead = x + half * v
        middle = newton(IncrementalPotential(system, ahead, half * half, x, half, ahead), x, self.tolerance)
        return 2.0 * middle - x, 2.0 * (middle - x) / half - v
