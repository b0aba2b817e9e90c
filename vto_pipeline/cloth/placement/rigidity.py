"""Cloth that keeps its shape as far as what some of it is asked for allows.

As rigidly as possible (Sorkine & Alexa 2007, "As-rigid-as-possible surface modeling"): the surroundings of each vertex
turn as they like, and lengths hardly change. To these belong layers that lie on each other, a strap on a shirt: they
would part, and cross.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from vto_pipeline.cloth.placement.transfer import divergence, nearest_rotations
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.riding.surface_walk import first_of_each
from vto_pipeline.geometry.topology import edges, face_normals, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_CLOSE = 0.01  # m: layers so near move together
_ALIKE = 0.5  # cosine of the angle between the normals of layers that do: legs and arms face each other
_FIRM = 0.05  # m: over this length along the cloth, a wish of weight 1 outweighs keeping shape


class Rigidity:
    """A garment whose parts move nearly rigidly.

    Args:
        garment: In the shape that it is to keep [m].
    """

    def __init__(self, garment: TriangleMesh) -> None:
        self._garment = garment
        matrix, self._area = laplacian(garment)
        self._matrix = (matrix + _between_layers(garment)).tocsr()
        edge = self._matrix.tocoo()
        apart = edge.row != edge.col
        self._i, self._j, self._stiffness = edge.row[apart], edge.col[apart], -edge.data[apart]
        self._pull = np.zeros(0)

    def follow(self, positions: FloatArray, wanted: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the positions that keep the turns of the given ones, and go where they are wanted [m], shape (V, 3).

        Args:
            positions: [m], shape (V, 3).
            wanted: [m], shape (V, 3).
            weight: Of each such wish, shape (V,); every connected piece needs one above zero.
        """
        pull = self._area / _FIRM**2 * weight
        turned = divergence(self._garment, self._matrix, self._turns(positions))
        if not np.array_equal(pull, self._pull):
            self._pull, self._factor = pull, splu((self._matrix + diags(pull)).tocsc())
        return np.asarray(self._factor.solve(turned + pull[:, None] * wanted))

    def _turns(self, positions: FloatArray) -> FloatArray:
        """Return how the surroundings of each vertex are turned from the garment to positions [m], shape (V, 3, 3)."""
        was, i, j = self._garment.vertices, self._i, self._j
        spread = np.zeros((len(positions), 3, 3))
        now = self._stiffness[:, None] * (positions[i] - positions[j])
        np.add.at(spread, i, now[:, :, None] * (was[i] - was[j])[:, None, :])
        return nearest_rotations(spread)


def _between_layers(garment: TriangleMesh) -> csr_matrix:
    """Return the Laplacian of links between layers, shape (V, V): of each vertex and the corners of a triangle near it.

    What is near on the same layer may be linked as well: it moves together anyhow.
    """
    count, faces = len(garment.vertices), garment.faces
    pair = edges(garment)
    beside = coo_matrix((np.ones(2 * len(pair)), (pair.ravel(), pair[:, ::-1].ravel())), (count, count)).tocsr()
    share = _spread(float(np.linalg.norm(np.diff(garment.vertices[pair], axis=1), axis=2).mean()))
    points = np.einsum("sk,fkd->fsd", share, garment.vertices[faces]).reshape(-1, 3)
    near = cKDTree(points).query_ball_point(garment.vertices, _CLOSE)
    vertex = np.repeat(np.arange(count), [len(found) for found in near])
    place = np.concatenate([np.asarray(found, dtype=np.int64) for found in near])
    face = place // len(share)
    apart = (vertex_normals(garment)[vertex] * face_normals(garment)[face]).sum(axis=1) > _ALIKE
    for k in range(3):
        corner = faces[face, k]
        apart &= (corner != vertex) & (np.asarray(beside[vertex, corner]).ravel() == 0.0)
    vertex, place, face = vertex[apart], place[apart], face[apart]
    first = first_of_each(vertex, np.linalg.norm(points[place] - garment.vertices[vertex], axis=1))
    vertex, place, face = vertex[first], place[first], face[first]
    row, col = np.repeat(vertex, 3), faces[face].ravel()
    weight = share[place % len(share)].ravel()
    both = coo_matrix((np.tile(weight, 2), (np.append(row, col), np.append(col, row))), (count, count)).tocsr()
    return csr_matrix(diags(np.asarray(both.sum(axis=1)).ravel()) - both)


def _spread(edge: float) -> FloatArray:
    """Return places in a triangle of such edges [m], half as far apart as layers that are close, shape (S, 3)."""
    parts = max(1, int(np.ceil(2.0 * edge / _CLOSE)))
    i, j = np.meshgrid(np.arange(parts), np.arange(parts), indexing="ij")
    within = (i + j < parts).ravel()
    one, other = (i.ravel()[within] + 1.0 / 3.0) / parts, (j.ravel()[within] + 1.0 / 3.0) / parts
    return np.column_stack([one, other, 1.0 - one - other])
