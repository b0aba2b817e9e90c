"""One-sided linear conditions on a few points of the cloth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray

_WIDTH = 5  # points of a row at most: an edge and a face


class SeparationRows(NamedTuple):
    """Conditions Σ cᵢ n · xᵢ >= level.

    Args:
        vertices: i, shape (K, 5). Where there are fewer, vertex 0 with coefficient 0.
        coefficients: cᵢ, shape (K, 5); 0 for what cannot move, whose part is in the level.
        normal: n, unit, shape (K, 3).
        level: [m], shape (K,).
    """

    vertices: IntArray
    coefficients: FloatArray
    normal: FloatArray
    level: FloatArray


def separation_rows(
    vertices: IntArray,
    coefficients: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    positions: FloatArray,
    free: int,
) -> SeparationRows:
    """Return rows Σ cᵢ n · xᵢ >= distance, in which only the first `free` vertices can move.

    Args:
        vertices, coefficients: Shapes (K, 1 to 5).
        normal: Shape (K, 3).
        distance: [m], shape (K,).
        positions: Of all vertices [m], shape (V, 3).
        free: How many of them can move.
    """
    held = vertices >= free
    away = np.einsum("ki,kid,kd->k", np.where(held, coefficients, 0.0), positions[vertices], normal)
    room = [(0, 0), (0, _WIDTH - vertices.shape[1])]
    return SeparationRows(
        np.pad(np.where(held, 0, vertices), room).astype(np.int32),
        np.pad(np.where(held, 0.0, coefficients), room),
        np.ascontiguousarray(normal),
        distance - away,
    )


def concatenate_rows(parts: list[SeparationRows]) -> SeparationRows:
    """Return all rows of the parts."""
    return SeparationRows(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))
