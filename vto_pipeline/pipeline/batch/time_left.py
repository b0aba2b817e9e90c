"""How long the rest of a batch takes: the forecast of its rows, corrected by how the first of them turned out."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping


class TimeLeft:
    """The time left of a batch, from when this is made.

    Args:
        expected: Row -> forecast [s]; infinite where there is none.
        workers: How many run at once.
    """

    def __init__(self, expected: Mapping[str, float], workers: int) -> None:
        known = sorted(seconds for seconds in expected.values() if math.isfinite(seconds))
        median = known[len(known) // 2] if known else None
        self._left = {n: s if math.isfinite(s) else 1.0 if median is None else median for n, s in expected.items()}
        self._is_known, self._workers = median is not None, workers
        self._done, self._began = 0.0, time.monotonic()

    def ended(self, name: str) -> None:
        """Note that a row has ended."""
        self._done += self._left.pop(name)

    def seconds(self) -> float | None:
        """Return the wall time left [s]; None where nothing was forecast and no row has ended.

        Once rows have ended, the rest takes as long for its share of the forecast as they did.
        """
        left = sum(self._left.values())
        if self._done:
            return left / self._done * (time.monotonic() - self._began)
        if not self._is_known:
            return None
        return max(left / self._workers, max(self._left.values(), default=0.0))
