"""Limits of the machine: memory bandwidth by STREAM's triad, and vector arithmetic.

Williams, Waterman & Patterson 2009: a kernel that moves B bytes for F operations takes at least max(B / bandwidth,
F / peak). The peak is what compiled code reaches without fused multiply-adds, which would change rounding. Stencils
that are solved one after the other, each from the last one's result, cannot fill vectors: they stay far below it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numba import njit, prange

from vto_pipeline.bench.timing import timed
from vto_pipeline.numerics.cpu_threads import limited_threads

_TRIAD_SECONDS = 0.05  # of one run of the triad
_LANES, _DEPTH = 64, 8
_OPERATIONS = 400_000_000


@cache
def bandwidth(working_set: int, threads: int) -> float:
    """Return what a triad over this many bytes moves [B/s]: cache for small sets, memory for large ones.

    McCalpin 1995 counts two reads and a write; where stores fetch the line first, the memory moves a third more.
    """
    count = max(working_set // 24, 1000)
    a, b, c = np.zeros(count), np.ones(count), np.ones(count)
    with limited_threads(threads):
        _, once = timed(lambda: _triad(a, b, c, 0.5, 1), warm=lambda: _triad(a, b, c, 0.5, 1))
        repeats = max(int(_TRIAD_SECONDS / max(once.seconds, 1e-7)), 1)
        _, timing = timed(lambda: _triad(a, b, c, 0.5, repeats))
    return 24.0 * count * repeats / timing.seconds


@cache
def peak(threads: int) -> float:
    """Return how many additions and multiplications this many threads do [1/s]."""
    sums = np.ones((threads, _LANES))
    length = _OPERATIONS // (2 * _LANES * _DEPTH)
    with limited_threads(threads):
        _, timing = timed(lambda: _multiply_add(sums, 0.999, length), warm=lambda: _multiply_add(sums, 0.999, 1))
    return 2.0 * _LANES * _DEPTH * length * threads / timing.seconds


@njit(cache=True, parallel=True)
def _triad(a, b, c, factor, repeats):  # type: ignore[no-untyped-def]
    for _ in range(repeats):
        for i in prange(len(a)):
            a[i] = b[i] + factor * c[i]


@njit(cache=True, parallel=True)
def _multiply_add(sums, factor, length):  # type: ignore[no-untyped-def]
    """Many independent chains side by side, each some steps deep between load and store."""
    for t in prange(len(sums)):
        lanes = np.ones(_LANES)
        for _ in range(length):
            for k in range(_LANES):
                s = lanes[k]
                for _ in range(_DEPTH):
                    s = s * factor + 0.1
                lanes[k] = s
        sums[t] = lanes
