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

from vto_pipeline.numerics.linear.elimination import BINS, Elimination
from vto_pipeline.numerics.linear.product_tile import (
    COLUMNS,
    PAIRS,
    TALL,
    subtract_pair,
    subtract_six,
    subtract_tall,
    subtract_three,
)

_SIDE_BY_SIDE = 4e6  # flops; with less, starting the threads costs more than they save
_SHARED = 1e6  # products; with more, all threads share what pivots make of the rest of a front
_TAKEN = 1e5  # entries passed on, likewise
_STRIP = 24  # rows that a thread takes at a time
_ABREAST = 8  # tiles that a thread divides by pivots at a time
_BESIDE = 24  # tiles, an even number, side by side: their share of the pivots then stays in the cache
_PIVOTS = 96  # at a time: what they make of a tile then stays in the cache


class Factor(NamedTuple):
    """Room for a factor, and for making it.

    Args:
        panels: The factor, by supernodes.
        passed: What supernodes pass on to their parents.
        good: Whether each supernode was factored: its pivots were positive, shape (S,).
    """

    panels: NDArray[np.float64]
    passed: NDArray[np.float64]
    good: NDArray[np.bool_]


def allocate_factor(plan: Elimination, before: Factor | None = None) -> Factor:
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
        out: From `allocate_factor`.
    """
    threaded = plan.flops >= _SIDE_BY_SIDE
    if threaded:
        _bins_parallel(plan, starts, blocks, weights, between, out)
    for b in range(BINS if threaded else 0, BINS + 1):
        _bin(b, plan, starts, blocks, weights, between, out)
    return out.good.all()


@njit(cache=True, error_model="numpy", parallel=True)
def _bins_parallel(plan, starts, blocks, weights, between, out):
    for b in prange(BINS):
        _bin(np.int64(b), plan, starts, blocks, weights, between, out)


@njit(cache=True, error_model="numpy")
def _bin(b, plan, starts, blocks, weights, between, out):
    """Factor the supernodes of a bin, children first, up to where one has no positive pivot."""
    threaded = b == BINS and plan.flops >= _SIDE_BY_SIDE  # the last bin comes alone
    for n in range(plan.bin_starts[b], plan.bin_starts[b + 1]):
        s = plan.binned[n]
        children = plan.children[plan.child_starts[s] : plan.child_starts[s + 1]]
        for c in children:
            if not out.good[c]:
                return
        wide = 3 * (plan.first[s + 1] - plan.first[s])
        tall = 3 * (plan.row_starts[s + 1] - plan.row_starts[s])
        panel = out.panels[plan.panels[s] : plan.panels[s + 1]].reshape(wide, wide + tall)
        rest = out.passed[plan.passed_at[s] : plan.passed_at[s] + tall * tall].reshape(tall, tall)
        panel[:] = 0.0
        for i in range(tall):
            rest[i, i:] = 0.0
        _gather(s, plan, starts, blocks, weights, between, panel, rest)
        for c in children:
            _extend_add(c, plan, out.passed, panel, rest, threaded)
        out.good[s] = _eliminate(panel, threaded)
        if not out.good[s]:
            return
        _update_schur_complement(panel, rest, threaded)


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
def _extend_add(c, plan, passed, panel, rest, threaded):
    """Add what child c passes on."""
    begin, end = plan.row_starts[c], plan.row_starts[c + 1]
    count = end - begin
    given = passed[plan.passed_at[c] : plan.passed_at[c] + 9 * count * count].reshape(3 * count, 3 * count)
    within = plan.within[begin:end]
    run = np.full(count, count)  # where the rows that follow each other from here on end
    for a in range(count - 2, -1, -1):
        run[a] = run[a + 1] if within[a + 1] == within[a] + 1 else a + 1
    if threaded and given.size >= _TAKEN:
        _extend_add_rows_parallel(given, within, run, panel, rest)
    else:
        _extend_add_rows(given, within, run, panel, rest, np.int64(0), count)


@njit(cache=True, error_model="numpy", parallel=True)
def _extend_add_rows_parallel(given, within, run, panel, rest):
    strips = (len(within) + _STRIP - 1) // _STRIP
    for k in prange(strips):
        first = _STRIP * _balanced_strip(np.int64(k), strips)
        _extend_add_rows(given, within, run, panel, rest, first, min(len(within), first + _STRIP))


@njit(cache=True, error_model="numpy")
def _extend_add_rows(given, within, run, panel, rest, first, last):
    """Add some of the rows that a child passes on, each to a row of its own."""
    wide = len(panel)
    for a in range(first, last):
        for i in range(3):
            row = 3 * within[a] + i
            target, shift = (panel[row], 0) if row < wide else (rest[row - wide], wide)
            b = a
            while b < len(within):
                at = 3 * within[b] - shift
                _add(given[3 * a + i, 3 * b : 3 * run[b]], target[at:])
                b = run[b]


@njit(cache=True, error_model="numpy")
def _balanced_strip(k, strips):
    """Return the strip of a triangle that is the k-th to be taken: long and short ones in turn, for like work."""
    return k // 2 if k % 2 == 0 else strips - 1 - k // 2


@njit(cache=True, error_model="numpy")
def _add(source, target):
    for k in range(len(source)):
        target[k] += source[k]


@njit(cache=True, error_model="numpy")
def _eliminate(panel, threaded):
    """Factor the columns of a front, in place: row p becomes column p of the factor."""
    wide, total = panel.shape
    for first in range(0, wide, _PIVOTS):
        last = min(first + _PIVOTS, wide)
        shared = threaded and (last - first) ** 2 * (total - last) >= _SHARED
        alone = total - (total - last) // COLUMNS * COLUMNS if shared else total  # then come whole tiles, for all
        for begin in range(first, last, 3):
            _subtract_three(panel[first:], begin - first, panel, begin, alone)
            if not _pivot_three(panel, begin):
                return False
            _divide_three(panel, begin, begin + 3, alone)
        if shared:
            _divide_parallel(panel, first, last, alone)
        _subtract_all(panel[first:last], panel, last, wide, np.int64(0), threaded)
    return True


@njit(cache=True, error_model="numpy", parallel=True)
def _divide_parallel(panel, first, last, begin):
    """Factor some rows of a front from a column on, whole tiles, where those before are done."""
    beside = COLUMNS * _ABREAST
    strips = (panel.shape[1] - begin + beside - 1) // beside
    pivots = panel[first:]
    for strip in prange(strips):
        low = begin + beside * strip
        high = min(low + beside, panel.shape[1])
        for i in range(first, last, 3):
            for j in range(low, high, COLUMNS):
                subtract_three(pivots, i, pivots, j, i - first, panel, i, j)
            _divide_three(panel, i, low, high)


@njit(cache=True, error_model="numpy")
def _pivot_three(panel, i):
    """Factor three rows of a front on the diagonal; return whether the pivots are positive."""
    for q in range(i, i + 3):
        for p in range(i, q):
            for k in range(q, i + 3):
                panel[q, k] -= panel[p, q] * panel[p, k]
        if not panel[q, q] > 0.0:
            return False
        panel[q, q] = sqrt(panel[q, q])
        for k in range(q + 1, i + 3):
            panel[q, k] /= panel[q, q]
    return True


@njit(cache=True, error_model="numpy")
def _divide_three(panel, i, begin, end):
    """Divide some columns of three rows of a front by the rows' pivots."""
    one, two, three = panel[i, begin:end], panel[i + 1, begin:end], panel[i + 2, begin:end]
    first, second, third = 1.0 / panel[i, i], 1.0 / panel[i + 1, i + 1], 1.0 / panel[i + 2, i + 2]
    p, q, r = panel[i, i + 1], panel[i, i + 2], panel[i + 1, i + 2]
    for k in range(end - begin):
        a = first * one[k]
        b = second * (two[k] - p * a)
        one[k], two[k], three[k] = a, b, third * (three[k] - q * a - r * b)


@njit(cache=True, error_model="numpy")
def _subtract_three(pivots, count, panel, i, end):
    """Subtract what pivots make of three rows of their own front, from the diagonal to a column."""
    j = end - COLUMNS
    while j > i - COLUMNS and j >= 0:
        subtract_three(pivots, i, pivots, j, count, panel, i, j)
        j -= COLUMNS
    for k in range(i, i + 3):
        for m in range(k, j + COLUMNS):
            total = 0.0
            for p in range(count):
                total += pivots[p, k] * pivots[p, m]
            panel[k, m] -= total


@njit(cache=True, error_model="numpy")
def _update_schur_complement(panel, rest, threaded):
    """Subtract from what is passed on the products of the eliminated columns."""
    wide, tall = len(panel), len(rest)
    for first in range(0, wide, _PIVOTS):
        _subtract_all(panel[first : first + _PIVOTS], rest, np.int64(0), tall, wide, threaded)


@njit(cache=True, error_model="numpy")
def _subtract_all(pivots, rows, begin, end, shift, threaded):
    """Subtract what some pivots make of some rows of a front, each from its diagonal on.

    Entries before the diagonal are unused: tiles may reach over them.

    Args:
        pivots: Their rows, of the whole front.
        rows: Of the front, those from `shift` on.
        begin, end: Which of these: whole blocks of three.
        shift: Columns of the front before those of `rows`.
        threaded: Whether all threads share it, where that is worth it.
    """
    beside = _tiles(pivots, shift, rows.shape[1], begin)
    if threaded and len(pivots) * (end - begin) * (rows.shape[1] - begin) >= _SHARED:
        _subtract_parallel(pivots, beside, rows, begin, end, shift)
    else:
        _subtract(pivots, beside, rows, begin, end, shift)
    odd = rows.shape[1] % COLUMNS  # columns that no tile covers
    for i in range(begin, min(end, odd)):
        for j in range(i, odd):
            total = 0.0
            for p in range(len(pivots)):
                total += pivots[p, shift + i] * pivots[p, shift + j]
            rows[i, j] -= total


@njit(cache=True, error_model="numpy")
def _tiles(pivots, shift, width, begin):
    """Return the pivots' last columns from `begin` on by pairs of tiles, the last first, shape (T, P, 2 COLUMNS).

    So the inner loops read along memory; in a large front each pivot is on a page of its own. Of an odd
    number of tiles, the last has a pair to itself.
    """
    count = min((width - begin + COLUMNS - 1) // COLUMNS, width // COLUMNS)
    pairs = np.empty(((count + 1) // 2, len(pivots), 2 * COLUMNS))
    for p in range(len(pivots)):
        for n in range(count):
            first, at = shift + width - COLUMNS * (n + 1), _place_in_pair(n)
            for k in range(COLUMNS):
                pairs[n // 2, p, at + k] = pivots[p, first + k]
    return pairs


@njit(cache=True, error_model="numpy")
def _place_in_pair(n):
    """Return the column of its pair where tile n begins: the right half comes first."""
    return COLUMNS * (1 - n % 2)


@njit(cache=True, error_model="numpy", parallel=True)
def _subtract_parallel(pivots, beside, rows, begin, end, shift):
    strips = (end - begin + _STRIP - 1) // _STRIP
    for k in prange(strips):
        first = begin + _STRIP * _balanced_strip(np.int64(k), strips)
        _subtract(pivots, beside, rows, first, min(end, first + _STRIP), shift)


@njit(cache=True, error_model="numpy")
def _subtract(pivots, beside, rows, begin, end, shift):
    """Subtract from the columns of some rows that tiles cover; see `_subtract_all`."""
    width, count = rows.shape[1], len(pivots)
    above = np.empty((count, TALL))
    for first in range(0, width // COLUMNS, _BESIDE):
        i = begin
        while i < min(end, width - COLUMNS * first):
            tall = TALL if end - i >= TALL else 6 if end - i >= 6 else 3
            for p in range(count):
                for k in range(tall):
                    above[p, k] = pivots[p, shift + i + k]
            n, last = first, min(first + _BESIDE, (width - i + COLUMNS - 1) // COLUMNS, width // COLUMNS)
            while PAIRS and tall == TALL and n + 1 < last:
                subtract_pair(above, 0, beside[n // 2], 0, count, rows, i, width - COLUMNS * (n + 2))
                n += 2
            while n < last:
                j, at = width - COLUMNS * (n + 1), _place_in_pair(n)
                if tall == TALL:
                    subtract_tall(above, 0, beside[n // 2], at, count, rows, i, j)
                elif tall == 6:
                    subtract_six(above, 0, beside[n // 2], at, count, rows, i, j)
                else:
                    subtract_three(above, 0, beside[n // 2], at, count, rows, i, j)
                n += 1
            i += tall
