"""The connected pieces of a surface, and the rims of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vto_pipeline.model.arrays import IntArray


class SurfaceComponents(NamedTuple):
    """The connected pieces of a surface and their rims.

    Args:
        faces: Shape (F, 3).
        of_vertex: Piece of each vertex, shape (V,); vertices without faces are pieces too, without effect.
        rim: Edges at one face, as it runs, shape (R, 2).
        after: The edge of the rim that begins where each ends, shape (R,).
        loop: Loop of each edge of the rim, shape (R,).
        piece_of_loop: Shape (L,).
        flaw: Why nothing can be proven about this surface, or "".
    """

    faces: IntArray
    of_vertex: IntArray
    rim: IntArray
    after: IntArray
    loop: IntArray
    piece_of_loop: IntArray
    flaw: str


def surface_components(faces: NDArray[np.int32], count: int) -> SurfaceComponents:
    """Return the pieces of these faces, shape (F, 3), on this many vertices."""
    halves = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2).astype(np.int64)
    forth, back = halves[:, 0] * count + halves[:, 1], halves[:, 1] * count + halves[:, 0]
    ones = np.ones(len(halves), np.int8)
    of_vertex = connected_components(coo_matrix((ones, halves.T), (count, count)), directed=False)[1].astype(np.int32)
    rim = halves[~np.isin(forth, back)]
    begins = np.bincount(rim[:, 0], minlength=count)
    flaw = ""
    if len(np.unique(forth)) < len(forth):
        flaw = "an edge has more than two faces, or faces are turned against each other"
    elif begins.max(initial=0) > 1:
        flaw = "two rims meet in a vertex"
    at = np.full(count, -1, np.int32)
    at[rim[:, 0]] = np.arange(len(rim))
    after = at[rim[:, 1]]
    ring = coo_matrix((np.ones(len(rim), np.int8), (np.arange(len(rim)), np.maximum(after, 0))), (len(rim),) * 2)
    loops, loop = connected_components(ring, directed=False) if len(rim) > 0 else (0, np.empty(0))
    piece_of_loop = np.zeros(loops, np.int32)
    piece_of_loop[loop.astype(np.int64)] = of_vertex[rim[:, 0]]
    return SurfaceComponents(
        np.array(faces, np.int32),
        of_vertex,
        rim.astype(np.int32),
        after,
        loop.astype(np.int32),
        piece_of_loop,
        flaw,
    )
