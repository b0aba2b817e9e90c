"""Projected Gauss-Seidel for self-contact and body contact after a step without contacts."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.response.active_set import inverse_effective_mass, sum_at
from vto_pipeline.numerics.vector import add, axpy, dot, load, norm, scale, store, sub

_SWEEPS = 20


@njit(cache=True, error_model="numpy")
def separate_pairs(pairs, inverse_mass, start, x):
    """Move vertices so that no pair is nearer than it may, in place.

    The sum of the pushes of each pair, not each of them, is kept above zero, and friction inside the cone of that sum
    (Jean & Moreau 1992; Erleben 2007, section 4).

    Args:
        pairs: Of the cloth.
        inverse_mass: [1/kg], shape (V,); zero holds a vertex.
        start: Positions at the start of the step [m], shape (V, 3).
        x: Positions after it [m], shape (V, 3), changed.
    """
    pushed, rubbed = np.zeros(len(pairs.key)), np.zeros((len(pairs.key), 3))
    for _ in range(_SWEEPS):
        for p in range(len(pairs.key)):
            give = inverse_effective_mass(pairs, p, inverse_mass)
            if give == 0.0:
                continue
            n, now, before = load(pairs.normal, p), sum_at(pairs, p, x), sum_at(pairs, p, start)
            push = max(0.0, pushed[p] + (pairs.gap[p] - dot(n, add(now, load(pairs.fixed, p)))) / give)
            slip = sub(sub(now, before), load(pairs.carried, p))
            slip = axpy(-dot(n, slip), n, slip)
            rub = axpy(-1.0 / give, slip, load(rubbed, p))
            length, most = norm(rub), pairs.friction[p] * push
            if length > most:
                rub = scale(most / length, rub)
            shift = add(scale(push - pushed[p], n), sub(rub, load(rubbed, p)))
            pushed[p] = push
            store(rubbed, p, rub)
            for s in range(4):
                i = pairs.vertices[p, s]
                store(x, i, axpy(pairs.weights[p, s] * inverse_mass[i], shift, load(x, i)))
