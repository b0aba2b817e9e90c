"""Gauss-Seidel in parallel with the same bits for any number of threads: blocks of constraints in colours.

Constraints are put in Morton order and cut into blocks. Two blocks that share a vertex get different colours, so the
blocks of one colour may run at once, in any order, while inside a block they run one after the other. Blocks instead
of single constraints make few and large parallel regions: a region costs 5 to 50 µs, whatever is in it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.numerics.spatial.morton import morton_order

_BLOCK = 96  # constraints


class Blocks(NamedTuple):
    """An order of constraints for Gauss-Seidel.

    Args:
        order: Which constraint comes at each place, shape (N,).
        starts: Place of the first constraint of each block, and N, shape (B + 1,).
        colours: First block of each colour, and B, shape (K + 1,).
    """

    order: NDArray[np.int64]
    starts: NDArray[np.int64]
    colours: NDArray[np.int64]


def blocks(stencils: NDArray[np.int32], positions: NDArray[np.float64]) -> Blocks:
    """Return blocks of constraints for these vertices, shape (N, S), that lie at these positions, shape (V, 3)."""
    count = len(stencils)
    if count == 0:
        return Blocks(np.empty(0, np.int64), np.zeros(1, np.int64), np.zeros(1, np.int64))
    order = morton_order(positions[stencils].mean(axis=1)).astype(np.int64)
    block = np.arange(count) // _BLOCK
    colour = _colour_blocks(stencils[order], block, len(positions))
    by_colour = np.argsort(colour, kind="stable")
    place = np.empty(len(by_colour), np.int64)
    place[by_colour] = np.arange(len(by_colour))
    arranged = np.argsort(place[block], kind="stable")
    sizes = np.bincount(place[block])
    return Blocks(
        order[arranged],
        np.concatenate([[0], np.cumsum(sizes)]),
        np.concatenate([[0], np.cumsum(np.bincount(colour))]),
    )


@njit(cache=True)
def _colour_blocks(stencils, block, vertices):
    """Return the smallest free colour of each block, in turn.

    Colours are bits of one integer; where 63 are not enough (a fan of thousands about one vertex), a block gets its
    own.
    """
    count = block[-1] + 1
    taken = np.zeros(vertices, np.uint64)  # colours already used at each vertex
    colour = np.zeros(count, np.int64)
    first = own = 0
    for b in range(count):
        last = first
        used = np.uint64(0)
        while last < len(block) and block[last] == b:
            for k in range(stencils.shape[1]):
                used |= taken[stencils[last, k]]
            last += 1
        free = 0
        while free < 63 and (used >> np.uint64(free)) & np.uint64(1):
            free += 1
        colour[b] = free
        if free == 63:
            colour[b] += own
            own += 1
        for i in range(first, last):
            for k in range(stencils.shape[1]):
                taken[stencils[i, k]] |= np.uint64(1) << np.uint64(free)
        first = last
    return colour
