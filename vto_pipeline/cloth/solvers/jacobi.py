"""Jacobi's method on the multipliers, relaxed so that it converges, plain and with momentum."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.implicit_step.dual_system import Linearised, inner
from vto_pipeline.cloth.solvers.dual_descent import DualDescent

_EXPONENT = 0.6
_POWER_ITERATIONS = 15
_RELAXATION = 0.9  # share of the step at which the stiffest mode starts to grow; the estimate of it is from below


class PlainJacobi(DualDescent):
    """Each constraint on its own, all at once: λ ← λ + ω D⁻¹ r with ω = min(1, 0.9 · 2 / ρ(D⁻¹ A)).

    As slow as the sheet is stiff: the number of iterations grows with the condition of A.
    """

    def prepare(self) -> None:
        """See `DualDescent.prepare`."""
        self.relaxation = min(1.0, _RELAXATION * 2.0 / _largest_eigenvalue(self.linear))

    def factors(self, iteration: int, since: int) -> tuple[float, float]:
        """See `DualDescent.factors`."""
        return self.relaxation, 0.0


class Jacobi(PlainJacobi):
    """Jacobi's method with growing momentum, which needs about the root of the iterations of the plain one.

    Frâncu & Moldoveanu 2014: b = min(1, (i / N)^0.6) in iteration i of N, conjugate residuals with fixed factors.
    """

    def factors(self, iteration: int, since: int) -> tuple[float, float]:
        """See `DualDescent.factors`."""
        return self.relaxation, min(1.0, (iteration / self.sweeps) ** _EXPONENT) if since > 0 else 0.0


def _largest_eigenvalue(linear: Linearised) -> float:
    """Return ρ(D⁻¹ A), estimated from below by the power method; 1 where there are no constraints."""
    random = np.random.default_rng(0)
    vector = [random.standard_normal(one.shape) for one in linear.multipliers]
    product = [np.empty_like(one) for one in vector]
    value = 1.0
    for _ in range(_POWER_ITERATIONS):
        length = np.sqrt(inner(vector, vector))
        if length == 0.0:
            break
        value = length
        for one in vector:
            one /= length
        linear.apply(vector, product)
        linear.precondition(product, vector)
    return max(value, 1.0)
