"""Which triangle of a mesh each vertex of another belongs to, where cloth lies close to itself.

The nearest triangle that faces the same way is the right one nearly everywhere. Where layers lie closer than the two
meshes, it may be one of the next layer. Then neighbours on the riding mesh are far apart along the other. Such edges
are torn: the nearest point, followed along the surface from one end to the other, does not arrive where the other end
is bound. Patches between torn edges are bound anew from the cloth about them, the smallest first. Each stays as it was
unless that repairs more edges than it costs in distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vto_pipeline.geometry.riding.surface_walk import SurfaceWalk, first_of_each, spans
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edges, vertex_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_NEAR = 64  # triangles among which one that faces the same way is looked for
_ROUNDS = 2  # of turning back triangles; a triangle may share a corner with another one
_TORN_M_PER_EDGE = 0.5  # distance that a torn edge weighs, in mean edges of the mesh


def faces_ridden(rider: TriangleMesh, mesh: TriangleMesh) -> IntArray:
    """Return the triangle of a mesh on which each vertex of another rides, shape (R,).

    Args:
        rider: R vertices, in the pose of `mesh` [m].
        mesh: What it was made from, or what was made from it.
    """
    walk, normals = SurfaceWalk(mesh), vertex_normals(rider)
    face = SurfaceDistance(mesh).nearest(rider.vertices).face
    face = _facing_the_same_way(rider.vertices, normals, face, walk)
    face = _Patches(rider, normals, walk).rebind(face)
    for _ in range(_ROUNDS):
        face = _turned_back(rider, face, walk)
    return face


def _facing_the_same_way(points: FloatArray, normals: FloatArray, face: IntArray, walk: SurfaceWalk) -> IntArray:
    """Where the nearest triangle looks away from a vertex's normal, return the nearest one that does not, if any."""
    away = np.flatnonzero((normals * walk.normals[face]).sum(axis=1) < 0.0)
    if not len(away):
        return face
    count = min(_NEAR, len(walk.normals))
    _, by_centre = cKDTree(walk.mesh.vertices[walk.mesh.faces].mean(axis=1)).query(points[away], k=count)
    row, touching = walk.around(face[away])
    row, near = np.append(row, np.repeat(np.arange(len(away)), count)), np.append(touching, by_centre.ravel())
    fits = (normals[away[row]] * walk.normals[near]).sum(axis=1) >= 0.0
    row, near = row[fits], near[fits]
    first = first_of_each(row, walk.distance(points[away[row]], near))
    face = np.array(face)
    face[away[row[first]]] = near[first]
    return face


class _Patches:
    """Patches of the riding mesh between torn edges.

    Args:
        rider: It.
        normals: Of its vertices.
        walk: On the other mesh.
    """

    def __init__(self, rider: TriangleMesh, normals: FloatArray, walk: SurfaceWalk) -> None:
        self._points, self._normals, self._walk = rider.vertices, normals, walk
        self._links = edges(rider)
        self._by_end = np.argsort(self._links.ravel(), kind="stable")
        degree = np.bincount(self._links.ravel(), minlength=len(rider.vertices))
        self._first = np.cumsum([0, *degree]).astype(np.int32)

    def rebind(self, face: IntArray) -> IntArray:
        """Return the triangles with patches bound anew where that repairs torn edges."""
        whole = ~self._torn(self._links, face)
        if whole.all():
            return face
        face = np.array(face)
        piece, _ = self._pieces(np.ones(len(whole), dtype=bool))
        patch, size = self._pieces(whole)
        largest = np.zeros(len(size), dtype=bool)
        largest[patch[first_of_each(piece.astype(np.int64), -size[patch].astype(np.float64))]] = True
        small = np.flatnonzero(~largest)
        for number in small[np.argsort(size[small], kind="stable")]:
            self._rebind_patch(np.flatnonzero(patch == number), patch, face)
        return face

    def _rebind_patch(self, members: NDArray[np.int64], patch: IntArray, face: IntArray) -> None:
        """Change the triangles of a patch if that costs less; its vertices then belong to the patches about it."""
        _, place = spans(self._first[members], self._first[members + 1] - self._first[members])
        links = self._links[np.unique(self._by_end[place] // 2)]
        before, was = self._cost(members, links, face), (face[members], patch[members])
        open_ = set(members.tolist())
        while open_:
            inside = np.isin(links, list(open_))
            rim = inside.sum(axis=1) == 1
            end, start = links[rim][inside[rim]], links[rim][~inside[rim]]
            reached = self._walk.follow(self._points[start], face[start], self._points[end])
            first = first_of_each(end.astype(np.int64), self._walk.distance(self._points[end], reached))
            face[end[first]], patch[end[first]] = reached[first], patch[start[first]]
            open_ -= set(end.tolist())
        if self._cost(members, links, face) >= before:
            face[members], patch[members] = was

    def _cost(self, patch: NDArray[np.int64], links: IntArray, face: IntArray) -> float:
        """Torn edges, vertices on triangles that look away, and distances in half edges of the mesh."""
        apart = self._walk.distance(self._points[patch], face[patch]) / (_TORN_M_PER_EDGE * self._walk.edge_length)
        away = (self._normals[patch] * self._walk.normals[face[patch]]).sum(axis=1) < 0.0
        return float(apart.sum() + away.sum() + self._torn(links, face).sum())

    def _torn(self, links: IntArray, face: IntArray) -> NDArray[np.bool_]:
        """Whether from neither end of an edge the nearest point leads to where the other is bound, shape (E,)."""
        torn = ~self._walk.touching(*face[links].T)
        for one, other in (links.T, links.T[::-1]):
            open_ = np.flatnonzero(torn)
            start, end = one[open_], other[open_]
            reached = self._walk.follow(self._points[start], face[start], self._points[end])
            torn[open_] = ~self._walk.touching(reached, face[end])
        return torn

    def _pieces(self, keep: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
        """Return the piece of each vertex that the kept edges connect, and the size of each piece."""
        count, links = len(self._points), self._links[keep]
        number, label = connected_components(coo_matrix((np.ones(len(links)), links.T), (count, count)), directed=False)
        return label, np.bincount(label, minlength=number).astype(np.int32)


def _turned_back(rider: TriangleMesh, face: IntArray, walk: SurfaceWalk) -> IntArray:
    """Where the nearest points of a triangle's corners turn it over, let all three ride on one triangle.

    It happens in creases that are sharper than the riding mesh is fine.
    """
    corners = walk.mesh.vertices[walk.mesh.faces[face]]
    below = np.einsum("nk,nkj->nj", walk.nearest_on(rider.vertices, face)[0], corners)
    over = (_doubled_areas(below, rider.faces) * _doubled_areas(rider.vertices, rider.faces)).sum(axis=1) < 0.0
    if not over.any():
        return face
    ends = rider.faces[over]
    choices = face[ends]
    points = rider.vertices[ends].reshape(-1, 3)
    cost = [walk.distance(points, np.repeat(choice, 3)).reshape(-1, 3).sum(axis=1) for choice in choices.T]
    best = choices[np.arange(len(ends)), np.argmin(cost, axis=0)]
    face = np.array(face)
    for end in ends.T:
        face[end] = best
    return face


def _doubled_areas(points: FloatArray, faces: IntArray) -> FloatArray:
    a, b, c = points[faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)
