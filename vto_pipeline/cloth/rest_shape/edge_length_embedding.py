"""Nearest embedding with given edge lengths.

Levenberg-Marquardt on the squared errors of the lengths (Nocedal & Wright 2006, 10.3). A surface has about as many
edges as coordinates, so lengths that vary smoothly can be met almost exactly.
"""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.topology import edges, laid_edge_lengths
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.linear.block_matrix import pattern
from vto_pipeline.numerics.linear.direct import DirectSolver

_ROUNDS = 12
_HOLD = 1e-4  # weight of staying in place against the lengths: what the lengths leave open does not drift
_MET = 1e-5  # rms of relative errors that is not worth another round


def lengths_in_space(rest: RestShape, mesh: TriangleMesh) -> FloatArray:
    """Return positions near a garment's whose edges are as long as at rest [m], shape (V, 3).

    Args:
        rest: Its shape without forces. Without panels, its positions are those.
        mesh: Where it is now [m].
    """
    if rest.panels is None:
        return rest.positions
    lengths = laid_edge_lengths(mesh, rest.corners(mesh.faces))
    return embed_edge_lengths(mesh.vertices, edges(mesh), lengths)


def embed_edge_lengths(positions: FloatArray, pairs: IntArray, lengths: FloatArray) -> FloatArray:
    """Return positions near the given ones whose edges are as long as wanted, in the sense of least squares.

    Args:
        positions: Where the search begins [m], shape (V, 3).
        pairs: Ends of the edges, shape (E, 2).
        lengths: Wanted [m], shape (E,).
    """
    weight = 1.0 / lengths
    hold = _HOLD * float(np.median(weight)) ** 2 * np.eye(3)
    matrix, places = pattern(pairs[:, [0, 0, 1, 1]].ravel(), pairs[:, [0, 1, 0, 1]].ravel(), len(positions))
    solver = DirectSolver(matrix)
    signs = np.array([1.0, -1.0, -1.0, 1.0])[:, None, None]
    x = positions.copy()
    for _ in range(_ROUNDS):
        along = x[pairs[:, 1]] - x[pairs[:, 0]]
        now = np.linalg.norm(along, axis=1)
        wrong = weight * (now - lengths)
        if np.sqrt(np.mean(wrong**2)) < _MET:
            break
        slope = (weight / now)[:, None] * along
        products = signs * (slope[:, :, None] * slope[:, None, :])[:, None]
        matrix.blocks[:] = 0.0
        np.add.at(matrix.blocks, places, products.reshape(-1, 3, 3))
        matrix.blocks[matrix.diagonal] += hold
        solver.factorise(matrix.blocks)
        right = np.zeros_like(x)
        np.add.at(right, pairs[:, 0], wrong[:, None] * slope)
        np.subtract.at(right, pairs[:, 1], wrong[:, None] * slope)
        x += solver.solve(right)
    return x
