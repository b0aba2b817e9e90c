"""What several benches read off a cloth: distance of two shapes, strain of edges, and what leaving work out saves."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from vto_pipeline.bench.timing import Timing, timed
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

Ended = TypeVar("Ended")

PATIENCE = 20.0
"""A run that takes longer is not repeated [s]."""


def distance_mm(one: FloatArray, other: FloatArray) -> float:
    """Return how far two shapes of one mesh are apart, rms over vertices [mm]."""
    return float(1e3 * np.sqrt(((one - other) ** 2).sum(axis=1).mean()))


def edge_strain(positions: FloatArray, rest: FloatArray, faces: IntArray) -> FloatArray:
    """Return l / l₀ - 1 of each edge, shape (E,).

    Args:
        positions: Where the vertices are [m], shape (V, 3).
        rest: Where they are without strain [m], shape (V, 3).
        faces: Shape (F, 3).
    """
    ends = edges(TriangleMesh(rest, faces))
    now, before = (np.linalg.norm(x[ends[:, 1]] - x[ends[:, 0]], axis=1) for x in (positions, rest))
    return np.asarray(now / before - 1.0)


def saved(
    run: Callable[[bool], Ended], positions: Callable[[Ended], FloatArray]
) -> tuple[Ended, Timing, dict[str, float]]:
    """Return the result without what is not needed, its timing, and what this saves and changes.

    Args:
        run: Computes; whether with all work, as `force_all` has it.
        positions: The vertices of a result [m], shape (V, 3).
    """
    less, timing = timed(lambda: run(False), budget=PATIENCE)
    whole, of_whole = timed(lambda: run(True), budget=PATIENCE)
    apart = np.linalg.norm(positions(less) - positions(whole), axis=1)
    return (
        less,
        timing,
        {
            "saved_share": 1.0 - timing.seconds / of_whole.seconds,
            "whole_s": of_whole.seconds,
            "difference_mm": float(1e3 * apart.max()),
        },
    )
