"""How far each look at a cloth that settled was from where it came to lie: known only once it has ended.

A prediction bounds what is still to come, and may be much too careful for long. The true curve tells when the shape
was good enough. Some vertices stand for all, so that looks take little memory, however many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.cloth import TraceRow

_SOME = 1000  # vertices: the median of so many is within 2 % of its rank, the 95th percentile within 1 %


def some_positions(count: int) -> Callable[[FloatArray], FloatArray]:
    """Return what picks the vertices that stand for all of a mesh of so many, spread over it: (V, 3) to (S, 3)."""
    chosen = np.unique(np.linspace(0, count - 1, min(count, _SOME)).astype(np.int32))
    return lambda positions: positions[chosen]


def with_true_distances(trace: Sequence[TraceRow], looks: Sequence[FloatArray], final: FloatArray) -> list[TraceRow]:
    """Return the rows with the distances of their looks to the end.

    Args:
        trace: One row a look.
        looks: Where some vertices were [m], each of shape (S, 3).
        final: Where these ended [m], shape (S, 3).
    """
    rows = []
    for row, look in zip(trace, looks, strict=True):
        apart = 1e3 * np.linalg.norm(look - final, axis=1)
        median, p95 = (float(share) for share in np.percentile(apart, [50, 95]))
        rows.append(replace(row, true_mm_median=median, true_mm_p95=p95, true_mm_max=float(apart.max())))
    return rows
