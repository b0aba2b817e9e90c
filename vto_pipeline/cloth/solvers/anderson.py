"""Gauss-Seidel sweeps with Anderson's extrapolation."""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.implicit_step.geometric_stiffness import is_drift_removal_due, remove_primal_drift
from vto_pipeline.cloth.implicit_step.iterated import ImplicitStep
from vto_pipeline.cloth.solvers.gauss_seidel import GaussSeidel
from vto_pipeline.model.arrays import FloatArray

_WINDOW = 5
_GROWTH = 2.0  # of the change by a sweep since it was smallest, at which the extrapolation is given up


class Anderson(GaussSeidel):
    """Gauss-Seidel as a fixed-point map of positions, λ and pushes, extrapolated from its last five sweeps.

    Peng et al. 2018, "Anderson acceleration for geometry optimization and physics simulation". The weights are those
    that make the change of positions smallest, in the norm of the masses: λ may change along directions that move
    nothing. When the change has grown, the last sweep is taken as it is and the window begins anew.

    Args:
        model, sweeps, damping, max_speed: See `Iterated`.
    """

    def solve(self, step: ImplicitStep, x: FloatArray) -> None:
        """See `Iterated.solve`."""
        self.linear.reset()
        pressed = np.zeros((len(step.contacts.friction), *x.shape))
        parts = (x, *self.multipliers, pressed)
        root_mass = np.sqrt(np.where(self.model.inverse_mass > 0.0, self.model.mass, 0.0))[:, None]
        changes: list[FloatArray] = []
        results: list[FloatArray] = []
        smallest = np.inf
        for sweep in range(1, self.sweeps + 1):
            before = x.copy()
            self.sweep(step, x, pressed)
            change = (root_mass * (x - before)).ravel()
            size = float(np.linalg.norm(change))
            if not np.isfinite(size):
                break
            if size > _GROWTH * smallest:
                changes, results, smallest = [], [], np.inf
            smallest = min(smallest, size)
            changes = [*changes[-_WINDOW:], change]
            results = [*results[-_WINDOW:], np.concatenate([one.ravel() for one in parts])]
            if is_drift_removal_due(sweep, self.sweeps):
                remove_primal_drift(self.linear, self.model, step, x, pressed)
                changes, results, smallest = [], [], np.inf
            elif len(changes) > 1 and sweep < self.sweeps:
                _spread(_extrapolated(changes, results), parts)


def _extrapolated(changes: list[FloatArray], results: list[FloatArray]) -> FloatArray:
    """Return the combination of results whose change is smallest; Walker & Ni 2011, eq. 2.1."""
    differences = np.diff(np.array(changes), axis=0)
    weights = np.linalg.lstsq(differences.T, changes[-1], rcond=1e-12)[0]
    combined: FloatArray = results[-1] - weights @ np.diff(np.array(results), axis=0)
    return combined


def _spread(whole: FloatArray, parts: tuple[FloatArray, ...]) -> None:
    place = 0
    for one in parts:
        one[:] = whole[place : place + one.size].reshape(one.shape)
        place += one.size
