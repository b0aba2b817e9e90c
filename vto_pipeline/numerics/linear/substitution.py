"""Forward and backward substitution with the factor of `numerics.linear.cholesky`."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from vto_pipeline.numerics.linear.elimination import BINS

_SIDE_BY_SIDE = 2e5  # entries of a factor; with less, starting the threads costs more than they save


@njit(cache=True, error_model="numpy")
def solve(plan, factor, right, x):
    """Write the solution of A x = right, both of shape (N, 3).

    As in the factorisation, subtrees are gone through side by side, and what is summed does not depend on the threads.
    """
    y, passed = np.empty(3 * len(plan.order)), np.empty(3 * len(plan.rows))
    for j in range(len(plan.order)):
        for k in range(3):
            y[3 * j + k] = right[plan.order[j], k]
    threaded = plan.panels[-1] >= _SIDE_BY_SIDE
    if threaded:
        _forward_parallel(plan, factor, y, passed)
    alone = BINS if threaded else 0
    for b in range(alone, BINS + 1):
        _forward_bin(b, plan, factor, y, passed)
    for b in range(BINS, alone - 1, -1):
        _backward_bin(b, plan, factor, y)
    if threaded:
        _backward_parallel(plan, factor, y)
    for j in range(len(plan.order)):
        for k in range(3):
            x[plan.order[j], k] = y[3 * j + k]


@njit(cache=True, error_model="numpy", parallel=True)
def _forward_parallel(plan, factor, y, passed):
    for b in prange(BINS):
        _forward_bin(np.int64(b), plan, factor, y, passed)


@njit(cache=True, error_model="numpy", parallel=True)
def _backward_parallel(plan, factor, y):
    for b in prange(BINS):
        _backward_bin(np.int64(b), plan, factor, y)


@njit(cache=True, error_model="numpy")
def _forward_bin(b, plan, factor, y, passed):
    """Divide by the factor, children first; a front passes on what its rows beyond its own places are to be less."""
    for n in range(plan.bin_starts[b], plan.bin_starts[b + 1]):
        s = plan.binned[n]
        at, begin, end, panel = _front(s, plan, factor)
        wide, total = panel.shape
        front = np.zeros(total)
        front[:wide] = y[at : at + wide]
        for c in plan.children[plan.child_starts[s] : plan.child_starts[s + 1]]:
            for m in range(plan.row_starts[c], plan.row_starts[c + 1]):
                for k in range(3):
                    front[3 * plan.within[m] + k] += passed[3 * m + k]
        for p in range(0, wide, 3):
            one, two, three = panel[p, p:], panel[p + 1, p:], panel[p + 2, p:]
            alpha = front[p] / one[0]
            beta = (front[p + 1] - alpha * one[1]) / two[1]
            gamma = (front[p + 2] - alpha * one[2] - beta * two[2]) / three[2]
            front[p], front[p + 1], front[p + 2] = alpha, beta, gamma
            _subtract_three_from(alpha, one[3:], beta, two[3:], gamma, three[3:], front[p + 3 :])
        y[at : at + wide] = front[:wide]
        passed[3 * begin : 3 * end] = front[wide:]


@njit(cache=True, error_model="numpy")
def _backward_bin(b, plan, factor, y):
    """Divide by the factor's transpose, parents first."""
    for n in range(plan.bin_starts[b + 1] - 1, plan.bin_starts[b] - 1, -1):
        s = plan.binned[n]
        at, begin, end, panel = _front(s, plan, factor)
        wide, total = panel.shape
        front = np.empty(total)
        front[:wide] = y[at : at + wide]
        for m in range(begin, end):
            for k in range(3):
                front[wide + 3 * (m - begin) + k] = y[3 * plan.rows[m] + k]
        for p in range(wide - 3, -1, -3):
            one, two, three = panel[p, p:], panel[p + 1, p:], panel[p + 2, p:]
            alpha, beta, gamma = _products(one[3:], two[3:], three[3:], front[p + 3 :])
            gamma = (front[p + 2] - gamma) / three[2]
            beta = (front[p + 1] - beta - gamma * two[2]) / two[1]
            alpha = (front[p] - alpha - beta * one[1] - gamma * one[2]) / one[0]
            front[p], front[p + 1], front[p + 2] = alpha, beta, gamma
        y[at : at + wide] = front[:wide]


@njit(cache=True, error_model="numpy")
def _front(s, plan, factor):
    """Return the first of a front's own scalars, where its places beyond those begin and end, and its panel."""
    wide, begin, end = 3 * (plan.first[s + 1] - plan.first[s]), plan.row_starts[s], plan.row_starts[s + 1]
    panel = factor.panels[plan.panels[s] : plan.panels[s + 1]].reshape(wide, wide + 3 * (end - begin))
    return 3 * plan.first[s], begin, end, panel


@njit(cache=True, error_model="numpy", fastmath={"contract"}, forceinline=True)
def _subtract_three_from(a, one, b, two, c, three, target):
    for i in range(len(target)):
        target[i] -= a * one[i] + b * two[i] + c * three[i]


@njit(cache=True, error_model="numpy", fastmath={"contract", "reassoc"}, forceinline=True)
def _products(one, two, three, other):
    """Return the inner products of three rows with another one, summed in whatever order is fast: always the same."""
    a = b = c = 0.0
    for i in range(len(other)):
        a += one[i] * other[i]
        b += two[i] * other[i]
        c += three[i] * other[i]
    return a, b, c
