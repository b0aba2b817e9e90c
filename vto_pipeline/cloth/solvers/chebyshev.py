"""Jacobi's method with Chebyshev's semi-iterative acceleration."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.solvers.dual_descent import DualDescent

_PLAIN = 10  # iterations without acceleration at first, as in the paper, while gradients turn fast


class Chebyshev(DualDescent):
    """λ ← λ + ω (θ D⁻¹ r + Δλ) - Δλ: the polynomial that is smallest over all eigenvalues of D⁻¹ A.

    Golub & Varga 1961; Wang 2015, "A Chebyshev semi-iterative approach for accelerating projective and position-based
    dynamics", eq. 9, where the spectral radius comes from trial runs. Here it follows from bounds that always hold,
    since whatever lies outside grows exponentially. With s = λ_max(D⁻¹ (A - α̃)) of a stencil's own block, 0 for soft
    and 1 for rigid, all eigenvalues are below 1 + max Σ s over the stencils that meet in a vertex (Cauchy and Schwarz),
    and above the smallest 1 - s, as A - α̃ is positive semidefinite.
    """

    def prepare(self) -> None:
        """See `DualDescent.prepare`."""
        meeting = np.zeros(1)
        lowest = 1.0
        for rows in self.linear.kinds:
            softness = np.linalg.eigvals(rows.inverse @ rows.soft).real.min(axis=1, initial=1.0)
            lowest = min(lowest, float(softness.min(initial=1.0)))
            hardness = np.repeat(1.0 - softness, rows.vertices.shape[1])
            added = np.bincount(rows.vertices.ravel(), hardness)
            meeting = np.pad(meeting, (0, max(0, len(added) - len(meeting))))
            meeting[: len(added)] += added
        top = 1.0 + float(meeting.max())
        bottom = max(lowest, top / self.sweeps**2)  # in so few sweeps the slowest modes are out of reach
        self._mean = 2.0 / (top + bottom)
        self._radius = (top - bottom) / (top + bottom)

    def factors(self, iteration: int, since: int) -> tuple[float, float]:
        """See `DualDescent.factors`."""
        if since <= _PLAIN:
            self._omega = 2.0
            return self._mean, 0.0
        self._omega = 1.0 / (1.0 - 0.25 * self._radius**2 * self._omega)
        return self._omega * self._mean, self._omega - 1.0
