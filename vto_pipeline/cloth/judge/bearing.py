"""The force that surfaces in contact can bear, friction included."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from vto_pipeline.model.arrays import FloatArray

_ROUNDS = 50  # at most; a dozen are many
_DONE = 1e-10  # of the force: less is not worth another round


def residual_after_one_surface(force: FloatArray, outward: FloatArray, friction: float) -> FloatArray:
    """Return what is left of each force when one surface bears what it can of it, shape (N, 3) [N].

    It bears all of the force into it, and along it up to friction times that: Coulomb's law for what slides.

    Args:
        force: On each point [N], shape (N, 3).
        outward: Unit normal of what touches each, shape (N, 3).
        friction: Coulomb coefficient.
    """
    push = -np.sum(force * outward, axis=1)
    along = force + push[:, None] * outward
    length = np.linalg.norm(along, axis=1)
    slips = np.maximum(0.0, 1.0 - friction * push / np.maximum(length, np.finfo(float).tiny))
    return np.where(push[:, None] > 0.0, slips[:, None] * along, force)


def residual_after_all_surfaces(force: FloatArray, outward: FloatArray, friction: float) -> FloatArray:
    """Return the least that is left of a force when surfaces bear it within their cones of friction, shape (3,) [N].

    Non-negative least squares over rays of the cones, to which the ray of each cone that would take most of what is
    left is added until none would: the fully corrective conditional gradient method (Jaggi 2013, "Revisiting
    Frank-Wolfe", algorithm 3), here on a sum of cones.

    Args:
        force: On a point [N], shape (3,).
        outward: Unit normals of the surfaces, shape (K, 3).
        friction: Coulomb coefficient.
    """
    rays, left = -outward, force
    for _ in range(_ROUNDS):
        shares, _ = nnls(rays.T, force)
        left = force - shares @ rays
        along = left - np.sum(outward * left, axis=1)[:, None] * outward
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        steepest = friction * along - outward
        useful = steepest @ left > _DONE * np.linalg.norm(force)
        if not useful.any():
            break
        rays = np.vstack([rays, steepest[useful]])
    return np.asarray(left)
