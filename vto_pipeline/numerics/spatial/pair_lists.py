"""Lists of pairs of unknown length, collected by several threads."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Search = Callable[[NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]], None]
"""search(starts, found, counts) writes the pairs of chunk c to found[starts[c] : starts[c + 1]], as far as there is
room, and to counts[c] how many there are."""


def collect(search: Search, chunks: int, room: int) -> NDArray[np.int32]:
    """Return the pairs of all chunks, in their order, shape (N, 2).

    Args:
        search: Called once, or twice if there is not room enough.
        chunks: Parts of the work, each done by one thread.
        room: Pairs that a chunk is expected to find at most.
    """
    starts = np.arange(chunks + 1) * room
    counts = np.empty(chunks, np.int64)
    while True:
        found = np.empty((starts[-1], 2), np.int32)
        search(starts, found, counts)
        if (counts <= np.diff(starts)).all():
            none = found[:0]  # there may be no chunk
            return np.concatenate([none, *(found[at : at + count] for at, count in zip(starts, counts, strict=False))])
        starts = np.concatenate([[0], np.cumsum(counts)])
