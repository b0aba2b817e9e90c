"""Which features of two photos are each other's nearest, exactly.

SIFT's descriptors are 128 whole numbers up to 255: sums of their products stay below 2^24, so single precision adds
them without rounding, in any order. Every machine and number of threads finds the same matches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray

RATIO = 0.8
"""The second nearest must be so much farther than the nearest (Lowe 2004), as an angle between descriptors."""
FARTHEST = 0.7
"""Descriptors at a larger angle show different things [rad]."""
NORM = 512.0
"""Length of COLMAP's descriptors."""
BLOCK = 1024
"""Features of the first photo whose products with all of the second are in memory at a time."""


class Lines(NamedTuple):
    """Where two photos were taken, as the epipolar lines of N and M features tell it.

    Args:
        line: In the second photo, of the first one's features, shape (N, 3).
        line_back: In the first photo, of the second one's, shape (M, 3).
        ray: Of the second one's features, at a focal length of 1, shape (M, 3).
        most: Sampson's distance (1982) that a match may have, at a focal length of 1.
    """

    line: FloatArray
    line_back: FloatArray
    ray: FloatArray
    most: float

    def hold(self, rows: NDArray[np.uint32]) -> NDArray[np.bool_]:
        """Return which matches (K, 2) of the features are near each other's lines, shape (K,)."""
        line, back, ray = self.line[rows[:, 0]], self.line_back[rows[:, 1]], self.ray[rows[:, 1]]
        slope = (line[:, :2] ** 2).sum(axis=1) + (back[:, :2] ** 2).sum(axis=1)
        return np.asarray((line * ray).sum(axis=1) ** 2 <= self.most**2 * slope)


def nearest_matches(
    first: NDArray[np.float32], second: NDArray[np.float32], lines: Lines | None = None
) -> NDArray[np.uint32]:
    """Return the pairs of features that are each other's nearest, and clearly nearer than the second nearest, (K, 2).

    Args:
        first, second: Descriptors of length `NORM`, whole numbers, shape (N, 128) and (M, 128).
        lines: Only what lies near each other's epipolar lines is compared; None compares all.
    """
    if len(first) == 0 or len(second) == 0:
        return np.empty((0, 2), np.uint32)
    near = lines or Lines(np.zeros((len(first), 3)), np.zeros((len(second), 3)), np.zeros((len(second), 3)), -1.0)
    slopes = [(one[:, :2] ** 2).sum(axis=1) for one in (near.line, near.line_back)]
    ahead, back = _Best.of(len(first)), _Best.of(len(second))
    across = np.ascontiguousarray(second.T)
    for start in range(0, len(first), BLOCK):
        rows = slice(start, start + BLOCK)
        part = _Best(ahead.whose[rows], ahead.largest[rows], ahead.second[rows])
        sight = near.line[rows], slopes[0][rows], slopes[1], near.ray, near.most
        _best_two(first[rows] @ across, start, *sight, part, back)
    found = np.flatnonzero(ahead.clear())
    partner = ahead.whose[found]
    both = back.clear()[partner] & (back.whose[partner] == found)
    return np.column_stack([found[both], partner[both]]).astype(np.uint32)


class _Best(NamedTuple):
    """The largest product of each of N features, whose it is, and the second largest; shape (N,) each."""

    whose: NDArray[np.int32]
    largest: NDArray[np.float32]
    second: NDArray[np.float32]

    @classmethod
    def of(cls, count: int) -> _Best:
        """Nothing yet."""
        return cls(np.full(count, -1, np.int32), np.zeros(count, np.float32), np.zeros(count, np.float32))

    def clear(self) -> NDArray[np.bool_]:
        """Return which features have a nearest one that passes both tests."""
        angle, other = (np.arccos(np.minimum(one / NORM**2, 1.0)) for one in (self.largest, self.second))
        return np.asarray((self.whose >= 0) & (angle < FARTHEST) & (angle < RATIO * other))


@njit(cache=True, nogil=True)
def _best_two(products, start, line, slope, slope_back, ray, most, ahead, back):  # type: ignore[no-untyped-def]
    """Update the best two of rows and columns of products (N, M), whose first row is feature `start`.

    With `most` negative, all are compared; else those within it of each other's lines.
    """
    for i in range(products.shape[0]):
        for k in range(products.shape[1]):
            product = products[i, k]
            if product <= ahead.second[i] and product <= back.second[k]:
                continue
            if most >= 0.0:
                off = line[i, 0] * ray[k, 0] + line[i, 1] * ray[k, 1] + line[i, 2] * ray[k, 2]
                if off * off > most * most * (slope[i] + slope_back[k]):
                    continue
            if product > ahead.largest[i]:
                ahead.second[i], ahead.largest[i], ahead.whose[i] = ahead.largest[i], product, k
            elif product > ahead.second[i]:
                ahead.second[i] = product
            if product > back.largest[k]:
                back.second[k], back.largest[k], back.whose[k] = back.largest[k], product, start + i
            elif product > back.second[k]:
                back.second[k] = product
