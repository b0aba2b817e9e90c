"""The nearest point on a surface, followed along it from triangle to triangle, never across a gap to another layer."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

from vto_pipeline.geometry.topology import edges, face_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.distance import barycentric_point, closest_on_triangle
from vto_pipeline.numerics.vector import load, load_at, norm, store, sub


class SurfaceWalk:
    """A surface to walk on.

    Args:
        mesh: Its triangles; edges may have any number of them.
    """

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self.normals = face_normals(mesh)
        one, other = mesh.vertices[edges(mesh)].transpose(1, 0, 2)
        self.edge_length = float(np.linalg.norm(one - other, axis=1).mean())
        count = len(mesh.faces)
        holds = coo_matrix((np.ones(3 * count, np.int32), (np.repeat(np.arange(count), 3), mesh.faces.ravel())))
        self._around = (holds.tocsr() @ holds.tocsr().T).tocsr()

    def nearest_on(self, points: FloatArray, face: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return barycentric weights (N, 3) and distance [m] (N,) of the nearest point of a triangle to each point."""
        return nearest_in_triangles(points, self.mesh.vertices[self.mesh.faces[face]])

    def distance(self, points: FloatArray, face: IntArray) -> FloatArray:
        """Return how far each point is from a triangle [m], shape (N,)."""
        return self.nearest_on(points, face)[1]

    def touching(self, one: IntArray, other: IntArray) -> NDArray[np.bool_]:
        """Return whether two triangles are the same or share a corner, shape (N,)."""
        faces = self.mesh.faces
        return np.asarray((faces[one][:, :, None] == faces[other][:, None, :]).any(axis=(1, 2)))

    def around(self, face: IntArray) -> tuple[NDArray[np.int64], IntArray]:
        """Return pairs of a row of `face` and a triangle that touches that one; in the order of rows."""
        start, end = self._around.indptr[face], self._around.indptr[face + 1]
        row, place = spans(start, end - start)
        return row, self._around.indices[place]

    def settle(self, points: FloatArray, face: IntArray) -> IntArray:
        """Return the triangle where each point ends that goes on to the nearest touching one, until none is nearer."""
        face = np.array(face)
        distance = self.distance(points, face)
        live = np.arange(len(face))
        while len(live):
            row, near = self.around(face[live])
            found = self.distance(points[live[row]], near)
            first = first_of_each(row, found)
            better = found[first] < distance[live]
            live, first = live[better], first[better]
            face[live], distance[live] = near[first], found[first]
        return face

    def follow(self, begin: FloatArray, face: IntArray, end: FloatArray) -> IntArray:
        """Return the triangles reached by the nearest points of what moves straight from begin to end, shape (N,).

        Args:
            begin: Points near `face` [m], shape (N, 3).
            face: Where their nearest points are.
            end: Where they go [m], in steps of an edge or less.
        """
        if not len(face):
            return face
        steps = max(1, int(np.ceil(np.linalg.norm(end - begin, axis=1).max() / self.edge_length)))
        for step in range(1, steps + 1):
            face = self.settle(begin + (end - begin) * (step / steps), face)
        return face


def first_of_each(row: NDArray[np.int64], cost: FloatArray) -> NDArray[np.int64]:
    """Return for each row that occurs, in rising order, where it has its least cost; the first of equals."""
    order = np.lexsort((cost, row))
    return np.asarray(order[np.flatnonzero(np.diff(row[order], prepend=-1))])


def spans(start: IntArray, count: IntArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the row and the place of each of `count` places from `start` on, row after row."""
    row = np.repeat(np.arange(len(start)), count)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(count) - count - start, count)


def nearest_in_triangles(points: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return barycentric weights (N, 3) and distance [m] (N,) of the nearest point of each triangle (N, 3, 3)."""
    weights, distance = np.empty((len(points), 3)), np.empty(len(points))
    _nearest_in_triangles(np.ascontiguousarray(points), np.ascontiguousarray(corners), weights, distance)
    return weights, distance


@njit(cache=True, error_model="numpy", parallel=True)
def _nearest_in_triangles(points, corners, weights, distance):  # type: ignore[no-untyped-def]  # typed by Numba
    for n in prange(len(points)):
        p, a, b, c = load(points, n), load_at(corners, n, 0), load_at(corners, n, 1), load_at(corners, n, 2)
        shares, _ = closest_on_triangle(p, a, b, c)
        store(weights, n, shares)
        distance[n] = norm(sub(p, barycentric_point(shares, a, b, c)))
