"""Smoothing of vertex values along the surface."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags

from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh


def neighbour_mean(mesh: TriangleMesh) -> csr_matrix:
    """Return the matrix that gives each vertex the mean of its neighbours, shape (V, V)."""
    pair = edges(mesh)
    rows, columns = np.concatenate([pair, pair[:, ::-1]]).T
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), (len(mesh.vertices),) * 2).tocsr()
    degree = np.asarray(graph.sum(axis=1)).reshape(-1)
    return csr_matrix(diags(1.0 / np.maximum(degree, 1.0)) @ graph)


def smooth_values(mesh: TriangleMesh, values: FloatArray, rounds: int) -> FloatArray:
    """Return values (V,) or (V, D) after this many rounds of moving each half way to the mean of its neighbours."""
    mean = neighbour_mean(mesh)
    for _ in range(rounds):
        values = 0.5 * (values + mean @ values)
    return values
