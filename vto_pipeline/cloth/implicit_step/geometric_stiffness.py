"""Geometric stiffness omitted by position based dynamics: gradients turn while the multipliers grow.

Each sweep moves vertices along the gradients of its moment, so in the end M (x - x̃) is not ∇C(x)ᵀ λ + p. The
difference is a step of Newton's method on the first equation of backward Euler with M alone for a matrix, which
overshoots as soon as h² times the tension of a thread exceeds m l. So the mass is raised by row sums of Σ |λ ∂²C|
(Andrews et al. 2017, "Geometric stiffness for real-time constrained multibody dynamics"), where ∂²C is not asked of a
kind, but bounded: a gradient turns by about 2 |∇C| / l when a vertex moves by the size l of its stencil.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.cloth.implicit_step.dual_system import Linearised, inner
from vto_pipeline.cloth.implicit_step.iterated import ImplicitStep
from vto_pipeline.cloth.model.build import ClothModel
from vto_pipeline.model.arrays import FloatArray

_EVERY = 32  # sweeps; looking costs about two


def is_drift_removal_due(sweep: int, sweeps: int) -> bool:
    """Return whether to put back after this sweep, counted from 1, of this many in a step."""
    return sweep % _EVERY == 0 and sweep < sweeps


def remove_primal_drift(
    linear: Linearised, model: ClothModel, step: ImplicitStep, x: FloatArray, pressed: FloatArray
) -> None:
    """Move x [m], shape (V, 3), towards x̃ + W (∇C(x)ᵀ λ + p), in place.

    As long as the multipliers are farther off, |missing|_M < (rᵀ D⁻¹ r)^½, nothing is done: λ is still on its path, and
    what it puts into a turning sheet it would have to take back.

    Args:
        linear: With λ; linearised here.
        model: The cloth.
        step: The step.
        x: Positions.
        pressed: Pushes of planes [kg m], shape (S, V, 3).
    """
    residual = linear.at(x, step.start, step.h)
    along = tuple(np.empty_like(one) for one in residual)
    linear.precondition(residual, along)
    pull = linear.pull(linear.multipliers) + pressed.sum(axis=0)
    missing = step.target + model.inverse_mass[:, None] * pull - x
    if np.vdot(missing, model.mass[:, None] * missing) < inner(residual, along):
        return
    moved = missing / (1.0 + model.inverse_mass * _stress(linear, x))[:, None]
    if (model.inverse_mass > 0.0).all():  # the cloth as a whole goes all the way, which keeps its momentum
        moved += model.mass @ (missing - moved) / model.mass.sum()
    x += moved


def _stress(linear: Linearised, x: FloatArray) -> FloatArray:
    """Return bounds of the row sums of Σ |λ ∂²C| [kg], shape (V,)."""
    total = np.zeros(len(x))
    for rows in linear.kinds:
        corners = x[rows.vertices]
        apart = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3)
        size = np.where(apart > 0.0, apart, np.inf).min(axis=(1, 2))
        steep = np.linalg.norm(rows.gradients, axis=3)
        bound = 2.0 * np.einsum("nb,nbs->ns", np.abs(rows.multipliers), steep) / size[:, None]
        total += np.bincount(rows.vertices.ravel(), bound.ravel(), minlength=len(x))
    return total
