"""Which seams are folds: of a collar's fall over its stand, of a cuff that is turned up.

Panels that stand about a body show their right sides outwards, so that two of them meet wrong side to wrong side: front
and back at a shoulder. Where a file stands two panels right side to right side, it has them folded over their seam.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_AGAINST = -0.5  # cosine between the right sides of two panels that are laid on each other


def folds(mesh: TriangleMesh, frames: FloatArray, twin: IntArray) -> NDArray[np.bool_]:
    """Return which half-edges the cloth is folded over at, right side to right side, shape (3F,).

    Args:
        mesh: Where its panels are placed [m].
        frames: Where the axes of each triangle's panel point, orthonormal columns, shape (F, 3, 2).
        twin: The other half of each half-edge, -1 for none, shape (3F,).
    """
    normals = np.cross(frames[:, :, 0], frames[:, :, 1])
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    here, there = np.arange(len(twin)) // 3, twin // 3
    way = middles[there] - middles[here]
    faces_it = (way * normals[here]).sum(axis=1) > 0.0
    is_faced = (way * normals[there]).sum(axis=1) < 0.0
    against = (normals[here] * normals[there]).sum(axis=1) < _AGAINST
    return np.asarray((twin >= 0) & against & faces_it & is_faced)


def inside_out(folded: NDArray[np.bool_], twin: IntArray) -> NDArray[np.bool_]:
    """Return which faces show their wrong side outwards: those beyond an odd number of folds, shape (F,).

    Args:
        folded: Half-edges that are folds, shape (3F,).
        twin: The other half of each half-edge, -1 for none, shape (3F,).
    """
    count = len(twin) // 3
    if not folded.any():
        return np.zeros(count, np.bool_)
    here, there = np.arange(len(twin)) // 3, twin // 3

    def graph(kept: NDArray[np.bool_], name: IntArray, size: int) -> coo_array:
        return coo_array((np.ones(int(kept.sum())), (name[here[kept]], name[there[kept]])), shape=(size, size))

    parts, part = connected_components(
        graph((twin >= 0) & ~folded, np.arange(count, dtype=np.int32), count), directed=False
    )
    order, before = breadth_first_order(graph(folded, part, parts).tocsr(), int(np.bincount(part).argmax()), False)
    out = np.zeros(parts, np.bool_)
    for one in order[1:]:
        out[one] = ~out[before[one]]
    return np.asarray(out[part])
