"""Triangulation of the polygons in mesh files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError

CUT_OFF = "the file is truncated or its header is wrong: export it again"


def fan_triangulation(polygons: NDArray[Any]) -> NDArray[np.int64]:
    """Split polygons of N corners into fans round their first corner.

    Args:
        polygons: Vertex indices, shape (F, N).

    Returns:
        Triangles, shape (F * (N - 2), 3); none for N < 3.
    """
    polygons = np.asarray(polygons).astype(np.int64)
    sides = polygons.shape[1]
    if sides < 3:
        return np.empty((0, 3), dtype=np.int64)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), sides - 2))
    return np.stack([first, polygons[:, 1:-1], polygons[:, 2:]], axis=2).reshape(-1, 3)


def triangulate_polygons(groups: Sequence[NDArray[Any]], path: Path) -> tuple[NDArray[np.int64], list[str]]:
    """Split groups of equal-sided polygons.

    Args:
        groups: Vertex indices, each of shape (F, N).
        path: The file, for messages.

    Returns:
        Triangles, shape (F, 3), and what was changed, for the log.

    Raises:
        FormatError: an index is not a whole number that fits 32 bits.
    """
    notes = []
    for group in groups:
        odd = ~((np.abs(group.astype(np.float64)) < 2**31) & (group == np.trunc(group)))
        if odd.any():
            raise FormatError(f"vertex index {group[odd][0]:g} is not a whole number below 2147483648", where=str(path))
    split = sum(len(group) for group in groups if group.shape[1] > 3)
    dropped = sum(len(group) for group in groups if group.shape[1] < 3)
    if split:
        notes.append(f"split {split} polygons with more than 3 corners into triangles")
    if dropped:
        notes.append(f"dropped {dropped} faces with fewer than 3 corners")
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *(fan_triangulation(group) for group in groups)]), notes
