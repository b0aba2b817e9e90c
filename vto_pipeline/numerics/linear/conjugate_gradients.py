"""Conjugate gradients for sparse symmetric positive definite systems of 3 x 3 blocks."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit, prange

from vto_pipeline.numerics.linear.block_matrix import CHUNK, PARALLEL_FROM, row_times
from vto_pipeline.numerics.linear.links import apply_links, apply_links_transposed
from vto_pipeline.numerics.linear.multigrid import v_cycle
from vto_pipeline.numerics.vector import dot, load


@njit(cache=True, error_model="numpy")
def pcg(levels, right, x, reference, tolerance, iterations, multigrid):
    """Solve A x = right by preconditioned conjugate gradients, in place.

    Hestenes & Stiefel 1952. Sums are taken by chunks of rows, then over the chunks in order, so the bits do not depend
    on the number of threads.

    Args:
        levels: The matrix A, symmetric positive definite, as first level; see `multigrid.update_hierarchy`.
        right: Shape (N, 3).
        x: First guess, and the solution, shape (N, 3).
        reference: What the residual is measured against, shape (N, 3): `right`, or less where some of it cancels.
        tolerance: Stop when the residual has fallen to this share of the reference, both by the root of the sum of
            squares and by that of r D⁻¹ r, which sees the soft directions.
        iterations: At most.
        multigrid: Precondition by a V-cycle; else by block Jacobi.

    Returns:
        The number of iterations, and the share of the residual that is left.
    """
    parts = np.empty((4, (len(x) + CHUNK - 1) // CHUNK))
    r, q, p, z = np.empty_like(x), np.empty_like(x), np.zeros_like(x), levels.guess
    matrix, links, inverse = levels.matrix, levels.links, levels.inverse
    threaded = len(x) >= PARALLEL_FROM
    whole, size, soft_whole, soft_size = _run(
        _BEGIN, matrix, links, inverse, reference, right, x, r, q, p, 0.0, parts, threaded
    )
    done = 0
    before = 1.0
    bound, soft_bound = tolerance * tolerance * whole, tolerance * tolerance * soft_whole
    while done < iterations and (size > bound or soft_size > soft_bound):
        if multigrid:
            levels.right[: len(x)] = r
            v_cycle(levels)
        else:
            _run(_JACOBI, matrix, links, inverse, z, right, x, r, q, p, 0.0, parts, threaded)
        rho, _, _, _ = _run(_INNER, matrix, links, inverse, z, right, x, r, q, p, 0.0, parts, threaded)
        _run(_TURN, matrix, links, inverse, z, right, x, r, q, p, rho / before if done > 0 else 0.0, parts, threaded)
        curvature, _, _, _ = _run(_MULTIPLY, matrix, links, inverse, z, right, x, r, q, p, 0.0, parts, threaded)
        if not curvature > 0.0:
            break
        size, soft_size, _, _ = _run(
            _STEP, matrix, links, inverse, z, right, x, r, q, p, rho / curvature, parts, threaded
        )
        before = rho
        done += 1
    return done, sqrt(size / whole) if whole > 0.0 else 0.0


_BEGIN, _JACOBI, _INNER, _TURN, _MULTIPLY, _STEP = range(6)


@njit(cache=True, error_model="numpy")
def _run(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts, threaded):
    """Do one part of an iteration for all rows; return four sums over the rows."""
    if what == _BEGIN:
        apply_links(links, 0, x)
    elif what == _MULTIPLY:
        apply_links(links, 0, p)
    if threaded:
        _run_parallel(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts)
    else:
        for chunk in range(parts.shape[1]):
            _run_chunk(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts, chunk)
    a = b = c = d = 0.0
    for chunk in range(parts.shape[1]):
        a += parts[0, chunk]
        b += parts[1, chunk]
        c += parts[2, chunk]
        d += parts[3, chunk]
    return a, b, c, d


@njit(cache=True, error_model="numpy", parallel=True)
def _run_parallel(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts):
    for chunk in prange(parts.shape[1]):
        _run_chunk(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts, chunk)


@njit(cache=True, error_model="numpy")
def _run_chunk(what, matrix, links, inverse, z, right, x, r, q, p, factor, parts, chunk):
    one = other = soft = soft_other = 0.0
    for i in range(CHUNK * chunk, min(len(x), CHUNK * chunk + CHUNK)):
        if what == _BEGIN:
            a, b, c = row_times(matrix, i, x)
            d, e, f = apply_links_transposed(links, i)
            r[i, 0], r[i, 1], r[i, 2] = right[i, 0] - a - d, right[i, 1] - b - e, right[i, 2] - c - f
            one += dot(load(z, i), load(z, i))
            other += dot(load(r, i), load(r, i))
            soft += _size(inverse, i, z)
            soft_other += _size(inverse, i, r)
        elif what == _JACOBI:
            for k in range(3):
                z[i, k] = inverse[i, k, 0] * r[i, 0] + inverse[i, k, 1] * r[i, 1] + inverse[i, k, 2] * r[i, 2]
        elif what == _INNER:
            one += r[i, 0] * z[i, 0] + r[i, 1] * z[i, 1] + r[i, 2] * z[i, 2]
        elif what == _TURN:
            for k in range(3):
                p[i, k] = z[i, k] + factor * p[i, k]
        elif what == _MULTIPLY:
            a, b, c = row_times(matrix, i, p)
            d, e, f = apply_links_transposed(links, i)
            a, b, c = a + d, b + e, c + f
            q[i, 0], q[i, 1], q[i, 2] = a, b, c
            one += p[i, 0] * a + p[i, 1] * b + p[i, 2] * c
        else:
            for k in range(3):
                x[i, k] += factor * p[i, k]
                r[i, k] -= factor * q[i, k]
            one += dot(load(r, i), load(r, i))
            other += _size(inverse, i, r)
    parts[0, chunk], parts[1, chunk], parts[2, chunk], parts[3, chunk] = one, other, soft, soft_other


@njit(cache=True, error_model="numpy")
def _size(inverse, i, r):
    """Return rᵀ D⁻¹ r of row i."""
    total = 0.0
    for k in range(3):
        total += r[i, k] * (inverse[i, k, 0] * r[i, 0] + inverse[i, k, 1] * r[i, 1] + inverse[i, k, 2] * r[i, 2])
    return total
