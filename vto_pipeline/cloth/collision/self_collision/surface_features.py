"""What of a surface can touch: its vertices, edges and faces, each vertex and edge owned by one face.

Who looks for pairs of faces, and takes from each only what it owns, finds every pair of features once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Features(NamedTuple):
    """Of a surface of F triangles with E edges; any surface, also one that is not manifold.

    A vertex or edge belongs to the first face at it. A vertex without faces belongs to none, and touches nothing.

    Args:
        faces: Shape (F, 3).
        edges: Each once, the smaller vertex first, in lexicographic order, shape (E, 2).
        own_vertices: Vertices that each face owns, then -1, shape (F, 3).
        own_edges: Edges that each face owns, then -1, shape (F, 3).
    """

    faces: NDArray[np.int32]
    edges: NDArray[np.int32]
    own_vertices: NDArray[np.int32]
    own_edges: NDArray[np.int32]


def features(faces: NDArray[np.int32], count: int) -> Features:
    """Return the features of these faces, shape (F, 3), on this many vertices."""
    halves = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    keys, edge = np.unique(halves.min(axis=1) * count + halves.max(axis=1), return_inverse=True)
    return Features(
        np.array(faces, np.int32),  # a copy that can be written, or Numba compiles its readers twice
        np.column_stack([keys // max(count, 1), keys % max(count, 1)]).astype(np.int32),
        _owned(faces),
        _owned(edge.reshape(-1, 3)),
    )


def _owned(parts: NDArray[np.signedinteger]) -> NDArray[np.int32]:
    """Return the parts (F, 3) of each face that no earlier face has, then -1."""
    owned = np.full(parts.size, -1, np.int32)
    first = np.unique(parts, return_index=True)[1]
    owned[first] = parts.reshape(-1)[first]
    rows = owned.reshape(-1, 3)
    return np.ascontiguousarray(np.take_along_axis(rows, np.argsort(rows < 0, axis=1, kind="stable"), axis=1))
