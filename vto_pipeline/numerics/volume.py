"""What a surface encloses, from the flux of each coordinate through it (divergence theorem)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FLAT = 0.01
"""Below this share of its area to the power 1.5, a piece's volume does not tell outside from inside."""


def axis_volumes(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], piece: NDArray[np.integer], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the volume inside each piece, once from each axis, and each piece's area.

    All three are the volume of a closed piece, negative where it is inside out. Counted from the piece's centre of
    area, they still tell the sides of an open one: an end or a floor square to an axis adds to that axis only.

    Args:
        vertices: [m], shape (V, 3).
        faces: Shape (F, 3).
        piece: Of each face, shape (F,).
        count: Of the pieces, P.

    Returns:
        Volumes [m³], shape (P, 3); areas [m²], shape (P,).
    """
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area_vectors = 0.5 * np.cross(b - a, c - a)
    size = np.linalg.norm(area_vectors, axis=1)
    middle = (a + b + c) / 3.0
    area: NDArray[np.float64] = np.bincount(piece, size, count).astype(np.float64)
    weight = np.maximum(area, np.finfo(float).tiny)
    center = np.column_stack([np.bincount(piece, size * middle[:, d], count) / weight for d in range(3)])
    flux = area_vectors * (middle - center[piece])
    return np.column_stack([np.bincount(piece, flux[:, d], count) for d in range(3)]), area
