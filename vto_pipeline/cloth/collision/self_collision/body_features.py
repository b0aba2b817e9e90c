"""Features of mesh bodies beside the cloth, as contact candidates from outside.

A cloth's vertices are held before the faces of a body by planes; what this adds is what passes between its vertices: a
body's vertices and the cloth's faces, and edges and edges. Positions are those of the cloth, then of the bodies;
features are numbered likewise, the cloth's first.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.self_collision.candidates import cross_candidates
from vto_pipeline.cloth.collision.self_collision.surface_features import Features, features
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.numerics.distance import closest_on_segments, closest_on_triangle
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.pseudonormals import pseudonormals, update_pseudonormals
from vto_pipeline.numerics.vector import axpy, dot, load, store, sub

_ROUNDING = 1e-9  # share of a distance, far above what rounding can do


class Candidates(NamedTuple):
    """What may meet: a vertex and a face, shape (N, 2), two edges, shape (M, 2)."""

    to_face: IntArray
    to_edge: IntArray

    @property
    def size(self) -> int:
        """How many."""
        return len(self.to_face) + len(self.to_edge)

    def subset(self, kept: NDArray[np.bool_]) -> Candidates:
        """Return those kept, of all of them in their order, shape (N + M,)."""
        count = len(self.to_face)
        return Candidates(self.to_face[kept[:count]], self.to_edge[kept[count:]])

    def concatenated(self, other: Candidates) -> Candidates:
        """Return these, then those."""
        return Candidates(np.vstack([self.to_face, other.to_face]), np.vstack([self.to_edge, other.to_edge]))


def no_candidates() -> Candidates:
    """Return none."""
    return Candidates(np.empty((0, 2), np.int32), np.empty((0, 2), np.int32))


class BodyFeatures:
    """All mesh bodies as one surface beside a cloth.

    Args:
        bodies: At least one.
        cloth: Features of the cloth.
        count: Its vertices V.

    Attributes:
        features: Of the cloth and the bodies.
        friction: Coulomb coefficient at each vertex of the bodies, shape (B,).
        begin, end: Where these are at the start and end of the step [m], shape (B, 3).
        moves: Which of them move in it, shape (B,).
    """

    def __init__(self, bodies: Sequence[BodyCollider], cloth: Features, count: int) -> None:
        self._bodies = bodies
        self._cloth = cloth
        self._count = count
        counts = [body.count for body in bodies]
        first = np.cumsum([0, *counts])
        faces = np.vstack([body.faces + np.int32(at) for body, at in zip(bodies, first, strict=False)])
        self._own = features(faces, int(first[-1]))
        self.features = features(np.vstack([cloth.faces, faces + np.int32(count)]), count + int(first[-1]))
        self.friction = np.repeat([body.friction for body in bodies], counts)
        self._beside = _adjacent_faces(self._own)
        corners = np.argsort(faces.ravel(), kind="stable")
        self._around = corners // 3
        self._around_starts = np.searchsorted(faces.ravel()[corners], np.arange(int(first[-1]) + 1))
        self._shown = np.empty(0, np.bool_)
        self._shown_vertices = np.empty(0, np.bool_)
        self.begin = self.end = self._places(0.0)
        self._fitted_to = (self.begin, self.end)
        self._normals = pseudonormals(self.begin, faces)
        self._find_convex()
        self._tree = bvh.build(self.begin, faces)
        self.set_time_span(0.0, 0.0)

    def set_time_span(self, begin: float, end: float) -> None:
        """Take the bodies to a step between these times [s]."""
        self.begin, self.end = self._places(begin), self._places(end)
        self.moves = (self.begin != self.end).any(axis=1)
        now = (self.begin, self.end)
        if not all(map(np.array_equal, now, self._fitted_to)):
            update_pseudonormals(self._normals, self.begin, self._own.faces)
            self._find_convex()
            bvh.refit_swept(self._tree, *now, self._own.faces, np.zeros(len(self.begin)))
            self._fitted_to = now
        shown = np.concatenate([body.touchable_faces for body in self._bodies])
        if not np.array_equal(shown, self._shown):
            self._shown = shown
            self._shown_vertices = np.zeros(len(self.begin), np.bool_)
            self._shown_vertices[self._own.faces[shown]] = True

    @property
    def step(self) -> float:
        """How far any of their vertices moves in the step [m]."""
        return float(np.linalg.norm(self.end - self.begin, axis=1).max())

    def search(self, tree: bvh.Bvh, x: FloatArray, end: FloatArray, radius: FloatArray) -> Candidates:
        """Return what may meet while no vertex is farther than its radius from its straight path.

        Args:
            tree: Over the cloth's faces, fitted to this.
            x, end: Positions of the cloth [m], shape (V, 3).
            radius: [m], shape (V,).
        """
        found = cross_candidates(tree, self._cloth, x, end, radius, self._tree, self._own, self.begin, self.end)
        faces, edges = np.int32(len(self._cloth.faces)), np.int32(len(self._cloth.edges))
        to_body, to_cloth, to_edge = found
        to_body[:, 1] += faces
        to_cloth[:, 0] += np.int32(self._count)
        to_edge[:, 1] += edges
        candidates = Candidates(np.vstack([to_body, to_cloth]), to_edge)
        return candidates.subset(self._separation_vectors(candidates, x, np.abs(end - x) + radius[:, None], radius)[1])

    def with_bodies(self, x: FloatArray, after: bool) -> FloatArray:
        """Return positions of the cloth [m] (V, 3), then of the bodies before or after the step."""
        return np.concatenate([x, self.end if after else self.begin])

    def approached_from_outside(
        self, candidates: Candidates, x: FloatArray, end: FloatArray, reach: FloatArray
    ) -> Candidates:
        """Return those that may come nearer than they may, if the cloth comes from outside: planes lead out the rest.

        A vertex is outside a face before its plane; an edge is outside another in the angle between its faces; a face
        is, where it is nearest, outside a vertex before any of the faces of one that stands out, else on the side of
        its pseudonormal. Where a surface ends there is no inside. What has a vertex inside is on its way out.

        Args:
            candidates: Of `search`.
            x, end: Positions of the cloth, which moves straight between them [m], shape (V, 3).
            reach: How far each vertex wants to be from bodies [m], shape (V,).
        """
        way, near = self._separation_vectors(candidates, x, end - x, reach)
        candidates, way = candidates.subset(near), way[near]
        inside = np.zeros(self._count + len(self.begin), np.bool_)
        for body in self._bodies:
            inside[: self._count] |= body.contained_vertices(self._count)
        to_body = candidates.to_face[:, 0] < self._count
        vertex, face = candidates.to_face[~to_body, 0] - self._count, candidates.to_face[to_body, 1]
        first = len(to_body)
        out: NDArray[np.bool_] = np.asarray(~inside[self._corners(candidates)].any(axis=1))
        out[:first][to_body] &= self._outside_faces(face - len(self._cloth.faces), way[:first][to_body])
        out[:first][~to_body] &= self._outside_vertices(vertex, -way[:first][~to_body])
        out[first:] &= self._outside_edges(candidates.to_edge[:, 1] - len(self._cloth.edges), way[first:])
        return candidates.subset(out)

    def _separation_vectors(
        self, candidates: Candidates, x: FloatArray, most: FloatArray, reach: FloatArray
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the ways from the second features to the first [m], shape (N + M, 3), and which may become too short.

        Args:
            candidates: Of `search`.
            x, most: Positions of the cloth, and how far its vertices go at most [m], shape (V, 3).
            reach: How far each wants to be from bodies [m], shape (V,).
        """
        steps = np.concatenate([np.linalg.norm(most, axis=1) + reach, np.linalg.norm(self.end - self.begin, axis=1)])
        return _separation_vectors(self.with_bodies(x, False), self.features, *candidates, steps * (1.0 + _ROUNDING))

    def _outside_faces(self, face: IntArray, way: FloatArray) -> NDArray[np.bool_]:
        return np.asarray(self._shown[face] & (_dot(way, self._normals.faces[face]) > 0.0))

    def _outside_vertices(self, vertex: IntArray, way: FloatArray) -> NDArray[np.bool_]:
        """Return whether ways from vertices of the bodies go outside.

        The pseudonormal tells that only of ways to what the vertex is nearest to. What passes a thorn's tip is not.
        """
        out: NDArray[np.bool_] = np.asarray(_dot(way, self._normals.vertices[vertex]) > 0.0)
        asked = np.flatnonzero(~out & self._convex_vertices[vertex])
        first = self._around_starts[vertex[asked]]
        count = self._around_starts[vertex[asked] + 1] - first
        which = np.repeat(asked, count)
        face = self._around[np.repeat(first - np.cumsum(count) + count, count) + np.arange(len(which))]
        out[which[_dot(way[which], self._normals.faces[face]) > 0.0]] = True
        return np.asarray(self._shown_vertices[vertex] & (out | self._normals.rim_vertices[vertex]))

    def _outside_edges(self, edge: IntArray, way: FloatArray) -> NDArray[np.bool_]:
        """Return whether ways from edges of the bodies go outside."""
        one, other = self._beside[edge].T
        before = _dot(self._normals.faces[one], way) > 0.0
        behind = _dot(self._normals.faces[other], way) > 0.0
        out = np.where(self._convex[edge], before | behind, before & behind)
        return np.asarray((self._shown[one] | self._shown[other]) & (out | self._normals.rim_edges[edge]))

    def _find_convex(self) -> None:
        """Find which edges of the bodies stand out, and of which vertices all edges do."""
        first, second = (self._normals.faces[face] for face in self._beside.T)
        along = np.diff(self.begin[self._own.edges], axis=1)[:, 0]
        self._convex = _dot(np.cross(first, second), along) >= 0.0
        self._convex_vertices = np.ones(len(self.begin), np.bool_)
        self._convex_vertices[self._own.edges[~self._convex]] = False

    def _corners(self, candidates: Candidates) -> IntArray:
        """Return the four vertices of each, shape (N + M, 4)."""
        to_face, to_edge = candidates
        faces = np.column_stack([to_face[:, 0], self.features.faces[to_face[:, 1]]])
        return np.vstack([faces, self.features.edges[to_edge].reshape(-1, 4)])

    def moving(self, candidates: Candidates) -> NDArray[np.bool_]:
        """Return which have a part of a body that moves, shape (N + M,)."""
        moves = np.concatenate([np.zeros(self._count, np.bool_), self.moves])
        return np.asarray(moves[self._corners(candidates)].any(axis=1))

    def carried_displacement(self, candidates: Candidates) -> FloatArray:
        """Return how far the bodies carry each vertex of the cloth along in the step [m], shape (V, 3).

        As far as what it may meet goes on average; what meets nothing, as the nearest face of a body does.
        """
        step, corners = self.end - self.begin, self._corners(candidates)
        pair, corner = np.nonzero(corners >= self._count)
        of_body = np.zeros((len(corners), 3))
        np.add.at(of_body, pair, step[corners[pair, corner] - self._count])
        of_body /= np.maximum(np.bincount(pair, minlength=len(corners)), 1)[:, None]
        beside = np.zeros(len(corners), np.bool_)
        beside[pair] = True
        pair, corner = np.nonzero(beside[:, None] & (corners < self._count))
        met = np.bincount(corners[pair, corner], minlength=self._count)
        total = np.zeros((self._count, 3))
        np.add.at(total, corners[pair, corner], of_body[pair])
        total /= np.maximum(met, 1)[:, None]
        first = 0
        for body in self._bodies:
            face = body.nearest_faces(self._count)
            near = np.flatnonzero((face >= 0) & (met == 0))
            total[near] = step[first + body.faces[face[near]]].mean(axis=1)
            met[near] = 1
            first += body.count
        return total

    def _places(self, time: float) -> FloatArray:
        return np.concatenate([body.at(time) for body in self._bodies])


def _adjacent_faces(surface: Features) -> IntArray:
    """Return the face in which each edge runs from its smaller vertex to the other, and the one where it runs back.

    Where there is none of a kind, it is any at that edge. Shape (E, 2).
    """
    start, end = surface.faces, np.roll(surface.faces, -1, axis=1)
    size = int(surface.faces.max(initial=0)) + 1
    keys = surface.edges[:, 0].astype(np.int64) * size + surface.edges[:, 1]
    edge = np.searchsorted(keys, np.minimum(start, end).astype(np.int64) * size + np.maximum(start, end))
    face = np.repeat(np.arange(len(surface.faces), dtype=np.int32)[:, None], 3, axis=1)
    beside = np.empty((len(keys), 2), np.int32)
    beside[edge.ravel()] = face.ravel()[:, None]
    ahead = start < end
    beside[edge[ahead], 0], beside[edge[~ahead], 1] = face[ahead], face[~ahead]
    return beside


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", a, b))


@njit(cache=True, error_model="numpy")
def _separation_vectors(x, features, to_face, to_edge, steps):
    """Return the way to the first from the second feature where they are nearest, and whether their steps cover it.

    Args:
        x: Positions [m], shape (V, 3).
        features: With these vertices.
        to_face, to_edge: Shapes (N, 2) and (M, 2).
        steps: How far each vertex goes at most [m], shape (V,).
    """
    count = len(to_face)
    ways, near = np.empty((count + len(to_edge), 3)), np.empty(count + len(to_edge), np.bool_)
    for p in range(len(near)):
        if p < count:
            i, f = to_face[p, 0], to_face[p, 1]
            j, k, m = features.faces[f, 0], features.faces[f, 1], features.faces[f, 2]
            a, b, c, d = load(x, i), load(x, j), load(x, k), load(x, m)
            on, _ = closest_on_triangle(a, b, c, d)
            way = axpy(-on[0], b, axpy(-on[1], c, axpy(-on[2], d, a)))
            covered = steps[i] + max(steps[j], steps[k], steps[m])
        else:
            e, f = to_edge[p - count, 0], to_edge[p - count, 1]
            i, j, k, m = features.edges[e, 0], features.edges[e, 1], features.edges[f, 0], features.edges[f, 1]
            a, b, c, d = load(x, i), load(x, j), load(x, k), load(x, m)
            s, t = closest_on_segments(a, b, c, d)
            way = sub(axpy(s, sub(b, a), a), axpy(t, sub(d, c), c))
            covered = max(steps[i], steps[j]) + max(steps[k], steps[m])
        store(ways, p, way)
        near[p] = dot(way, way) <= covered * covered
    return ways, near
