"""Sparse Cholesky factorisation of a matrix of 3 x 3 blocks and its links: the multifrontal method.

Duff & Reid 1983; Liu 1992. Each supernode of the plan (`numerics.elimination`) gathers a dense front, eliminates its
own columns and passes the rest on to its parent. The rows of a stored panel are the columns of the factor, so all
inner loops run along memory. Subtrees are factored side by side; what a front sums, and in which order, does not
depend on the threads.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from vto_pipeline.numerics.elimination import BINS, Elimination

_SIDE_BY_SIDE = 4e6  # flops; with less, starting the threads costs more than they save
_TALL = 192  # rows that a front passes on; with more, all threads share it
_STRIP = 16  # of those rows, that a thread takes at a time
_ROWS = 4  # that are reduced together


class Factor(NamedTuple):
    """Room for a factor, and for making it.

    Args:
        panels: The factor, by supernodes.
        passed: What supernodes pass on to their parents.
        good: Whether each supernode's pivots were positive, shape (S,).
    """

    panels: NDArray[np.float64]
    passed: NDArray[np.float64]
    good: NDArray[np.bool_]


def factor_room(plan: Elimination, before: Factor | None = None) -> Factor:
    """Return room for a factor by this plan: what there was before, where that is enough."""
    good = np.zeros(len(plan.first) - 1, np.bool_)
    if before is not None and len(before.panels) >= plan.panels[-1] and len(before.passed) >= plan.room:
        return before._replace(good=good)
    return Factor(np.empty(int(plan.panels[-1])), np.empty(plan.room), good)


@njit(cache=True, error_model="numpy")
def factorise(plan, starts, blocks, weights, between, out):
    """Factor a matrix with links beside it; return whether it was positive definite.

    Args:
        plan: For the pattern of the matrix and for the links.
        starts, blocks: The matrix by rows; symmetric.
        weights, between: Of the links: of their vertices, shape (P, 4), and their blocks, shape (P, 3, 3).
        out: From `factor_room`.
    """
    threaded = plan.flops >= _SIDE_BY_SIDE
    if threaded:
        _bins_parallel(plan, starts, blocks, weights, between, out)
    else:
        for b in range(BINS):
            _bin(b, plan, starts, blocks, weights, between, out, False)
    _bin(BINS, plan, starts, blocks, weights, between, out, threaded)
    return out.good.all()


@njit(cache=True, error_model="numpy", parallel=True)
def _bins_parallel(plan, starts, blocks, weights, between, out):
    for b in prange(BINS):
        _bin(b, plan, starts, blocks, weights, between, out, False)


@njit(cache=True, error_model="numpy")
def _bin(b, plan, starts, blocks, weights, between, out, threaded):
    """Factor the supernodes of a bin, children first."""
    for n in range(plan.bin_starts[b], plan.bin_starts[b + 1]):
        s = plan.binned[n]
        wide = 3 * (plan.first[s + 1] - plan.first[s])
        tall = 3 * (plan.row_starts[s + 1] - plan.row_starts[s])
        panel = out.panels[plan.panels[s] : plan.panels[s + 1]].reshape(wide, wide + tall)
        rest = out.passed[plan.work_at[s] : plan.work_at[s] + tall * tall].reshape(tall, tall)
        panel[:] = 0.0
        rest[:] = 0.0
        _gather(s, plan, starts, blocks, weights, between, panel, rest)
        for c in plan.children[plan.child_starts[s] : plan.child_starts[s + 1]]:
            _take_over(c, plan, out.passed, panel, rest)
        out.good[s] = _eliminate(panel)
        if threaded and tall >= _TALL:
            _pass_on_parallel(panel, rest)
        else:
            _pass_on(panel, rest, 0, tall)
        if plan.kept_at[s] < plan.work_at[s]:
            _move(out.passed, plan.work_at[s], plan.kept_at[s], tall * tall)


@njit(cache=True, error_model="numpy")
def _gather(s, plan, starts, blocks, weights, between, panel, rest):
    """Add the entries of the matrix and of the links that a front is the first to touch."""
    for j in range(plan.first[s], plan.first[s + 1]):
        row, at = plan.order[j], 3 * (j - plan.first[s])
        for k in range(starts[row], starts[row + 1]):
            if plan.slots[k] >= 0:
                for a in range(3):
                    for b in range(3):
                        panel[at + a, 3 * plan.slots[k] + b] += blocks[k, a, b]
    wide = len(panel)
    for n in range(plan.link_starts[s], plan.link_starts[s + 1]):
        p = plan.linked[n]
        for c in range(weights.shape[1]):
            for d in range(weights.shape[1]):
                w = weights[p, c] * weights[p, d]
                row, column = 3 * plan.link_slots[p, c], 3 * plan.link_slots[p, d]
                if w == 0.0 or column < row:
                    continue
                for a in range(3):
                    for b in range(3):
                        if row < wide:
                            panel[row + a, column + b] += w * between[p, a, b]
                        else:
                            rest[row - wide + a, column - wide + b] += w * between[p, a, b]


@njit(cache=True, error_model="numpy")
def _take_over(c, plan, passed, panel, rest):
    """Add what child c passes on."""
    begin, end = plan.row_starts[c], plan.row_starts[c + 1]
    tall, wide = 3 * (end - begin), len(panel)
    given = passed[plan.kept_at[c] : plan.kept_at[c] + tall * tall].reshape(tall, tall)
    within = plan.within[begin:end]
    for a in range(end - begin):
        for i in range(3):
            source = given[3 * a + i]
            row = 3 * within[a] + i
            if row < wide:
                _scatter(source, within, a, panel[row], 0)
            else:
                _scatter(source, within, a, rest[row - wide], wide)


@njit(cache=True, error_model="numpy")
def _scatter(source, within, first, target, shift):
    for b in range(first, len(within)):
        at = 3 * within[b] - shift
        target[at] += source[3 * b]
        target[at + 1] += source[3 * b + 1]
        target[at + 2] += source[3 * b + 2]


@njit(cache=True, error_model="numpy")
def _eliminate(panel):
    """Factor the columns of a front, in place: row p becomes column p of the factor."""
    wide = len(panel)
    for first in range(0, wide, _ROWS):
        last = min(first + _ROWS, wide)
        _subtract(panel, first, panel, first, last, 0)
        for q in range(first, last):
            target = panel[q, q:]
            for p in range(first, q):
                _subtract_one(panel[p, q:], target)
            if not target[0] > 0.0:
                return False
            inverse = 1.0 / sqrt(target[0])
            for i in range(len(target)):
                target[i] *= inverse
    return True


@njit(cache=True, error_model="numpy")
def _subtract(panel, count, rows, first, last, shift):
    """Subtract from at most _ROWS rows of a front, from the diagonal of the first on, what some pivots make of them.

    Args:
        panel: The pivots' rows.
        count: Of pivots.
        rows: Where the rows lie.
        first, last: Which of them.
        shift: Columns of the front before those of `rows`.
    """
    p = 0
    q = shift + first
    if last - first == _ROWS:  # four by four, so that each number that is read serves four times
        r, s, t, u = rows[first, first:], rows[first + 1, first:], rows[first + 2, first:], rows[first + 3, first:]
        while p + 4 <= count:
            _subtract_four(panel[p, q:], panel[p + 1, q:], panel[p + 2, q:], panel[p + 3, q:], r, s, t, u)
            p += 4
    for k in range(first, last):
        for rest in range(p, count):
            _subtract_one(panel[rest, shift + k :], rows[k, k:])


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _subtract_four(one, two, three, four, r, s, t, u):
    """Subtract from rows r to u the products of pivots one to four; contracting a product and a sum loses nothing."""
    r1, r2, r3, r4 = one[0], two[0], three[0], four[0]
    s1, s2, s3, s4 = one[1], two[1], three[1], four[1]
    t1, t2, t3, t4 = one[2], two[2], three[2], four[2]
    u1, u2, u3, u4 = one[3], two[3], three[3], four[3]
    for i in range(len(r)):
        a, b, c, d = one[i], two[i], three[i], four[i]
        r[i] -= r1 * a + r2 * b + r3 * c + r4 * d
        s[i] -= s1 * a + s2 * b + s3 * c + s4 * d
        t[i] -= t1 * a + t2 * b + t3 * c + t4 * d
        u[i] -= u1 * a + u2 * b + u3 * c + u4 * d


@njit(cache=True, error_model="numpy")
def _subtract_one(one, target):
    a = one[0]
    for i in range(len(target)):
        target[i] -= a * one[i]


@njit(cache=True, error_model="numpy", parallel=True)
def _pass_on_parallel(panel, rest):
    tall = len(rest)
    strips = (tall + _STRIP - 1) // _STRIP
    for k in prange(strips):
        # long and short rows in turn, so that threads have like work
        strip = k // 2 if k % 2 == 0 else strips - 1 - k // 2
        _pass_on(panel, rest, _STRIP * strip, min(tall, _STRIP * strip + _STRIP))


@njit(cache=True, error_model="numpy")
def _pass_on(panel, rest, begin, end):
    """Subtract from some rows of what is passed on the products of the eliminated columns."""
    wide = len(panel)
    for first in range(begin, end, _ROWS):
        _subtract(panel, wide, rest, first, min(first + _ROWS, end), wide)


@njit(cache=True, error_model="numpy")
def _move(values, source, target, count):
    for k in range(count):
        values[target + k] = values[source + k]


@njit(cache=True, error_model="numpy")
def solve(plan, factor, right, x):
    """Write the solution of A x = right, both of shape (N, 3)."""
    y = np.empty(3 * len(plan.order))
    for j in range(len(plan.order)):
        for k in range(3):
            y[3 * j + k] = right[plan.order[j], k]
    tallest = 0
    for s in range(len(plan.first) - 1):
        tallest = max(tallest, 3 * (plan.first[s + 1] - plan.first[s] + plan.row_starts[s + 1] - plan.row_starts[s]))
    room = np.empty(tallest)
    for s in range(len(plan.first) - 1):
        _forward(s, plan, factor, y, room)
    for s in range(len(plan.first) - 2, -1, -1):
        _backward(s, plan, factor, y, room)
    for j in range(len(plan.order)):
        for k in range(3):
            x[plan.order[j], k] = y[3 * j + k]


@njit(cache=True, error_model="numpy")
def _forward(s, plan, factor, y, room):
    at, wide = 3 * plan.first[s], 3 * (plan.first[s + 1] - plan.first[s])
    begin, end = plan.row_starts[s], plan.row_starts[s + 1]
    total = wide + 3 * (end - begin)
    panel = factor.panels[plan.panels[s] : plan.panels[s + 1]].reshape(wide, total)
    front = room[:total]
    front[:wide] = y[at : at + wide]
    front[wide:] = 0.0
    for p in range(wide):
        column = panel[p]
        front[p] /= column[p]
        f = front[p]
        for i in range(p + 1, total):
            front[i] -= f * column[i]
    y[at : at + wide] = front[:wide]
    for n in range(begin, end):
        for k in range(3):
            y[3 * plan.rows[n] + k] += front[wide + 3 * (n - begin) + k]


@njit(cache=True, error_model="numpy")
def _backward(s, plan, factor, y, room):
    at, wide = 3 * plan.first[s], 3 * (plan.first[s + 1] - plan.first[s])
    begin, end = plan.row_starts[s], plan.row_starts[s + 1]
    total = wide + 3 * (end - begin)
    panel = factor.panels[plan.panels[s] : plan.panels[s + 1]].reshape(wide, total)
    front = room[:total]
    front[:wide] = y[at : at + wide]
    for n in range(begin, end):
        for k in range(3):
            front[wide + 3 * (n - begin) + k] = y[3 * plan.rows[n] + k]
    for p in range(wide - 1, -1, -1):
        column = panel[p]
        a = b = c = d = 0.0  # four sums, which need not wait for each other
        i = p + 1
        while i + 4 <= total:
            a += column[i] * front[i]
            b += column[i + 1] * front[i + 1]
            c += column[i + 2] * front[i + 2]
            d += column[i + 3] * front[i + 3]
            i += 4
        while i < total:
            a += column[i] * front[i]
            i += 1
        front[p] = (front[p] - ((a + b) + (c + d))) / column[p]
    y[at : at + wide] = front[:wide]
