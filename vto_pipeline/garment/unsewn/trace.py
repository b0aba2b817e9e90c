"""Lines drawn on a surface made edges of its mesh.

Each line is first followed along edges, which cannot fail where the surface is whole; then the vertices on the way are
drawn onto the line, and those around moved along with them, the less the farther, all of them on the surface as it was.
So no triangle is cut, none is much worse than before, and folds keep their vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.riding.surface_walk import SurfaceWalk
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import edge_face_counts, edges, face_area_vectors, half_edges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh

_NEAR = 1.5  # edges between a line's end and the rim, or another line, that it is meant to reach
_LOST = 4.0  # edges from a line: farther from it, the surface does not follow it
_AWAY = 4.0  # how much dearer an edge is that lies one edge length off the line
_RINGS = 3
_ROUNDS = 12
_SAMPLES = 0.25  # edges between points of a line
_LOOP = 6.0  # edges: a shorter line is not closed though its ends are near each other
_CROSSED = 0.6  # edges from a vertex of one line to another line that goes through it
_SLID = 0.6  # of an edge that a vertex at a rim or on a line moves along it at most
_GAP = 0.2  # of an even spacing: vertices on a line are never closer


def trace(mesh: TriangleMesh, lines: Sequence[FloatArray], names: Sequence[str] = ()) -> tuple[TriangleMesh, IntArray]:
    """Return a mesh of the same surface with lines along its edges, and which line each half-edge is on, or -1, (3F,).

    Ends of lines that are within one and a half edges of a rim, of another line or of another end meet it.

    Args:
        mesh: Manifold.
        lines: Points in order on or near the surface [m], shape (K, 3) each.
        names: Of the lines, for messages.

    Raises:
        GarmentError: a line leaves the surface, or the surface has no way along it.
    """
    tracer = _Tracer(mesh)
    for number, line in enumerate(lines):
        name = names[number] if number < len(names) else f"seam {number}"
        tracer.follow(number, np.asarray(line, dtype=np.float64), name)
    return tracer.relaxed(), tracer.seam()


class _Tracer:
    def __init__(self, mesh: TriangleMesh) -> None:
        self._mesh = mesh
        pair, count = edge_face_counts(mesh)
        self._pairs = pair
        self._lengths = np.linalg.norm(mesh.vertices[pair[:, 0]] - mesh.vertices[pair[:, 1]], axis=1)
        self._edge = float(np.median(self._lengths))
        self._around = neighbour_mean(mesh)
        self._rim = np.zeros(len(mesh.vertices), np.bool_)
        self._rim[pair[count == 1]] = True
        self._rim_edges = count == 1
        self._walk = SurfaceWalk(mesh)  # layers of cloth lie on each other in gathers: the nearest one may be another
        self._face = np.empty(len(mesh.vertices), np.int32)
        self._face[mesh.faces.ravel()] = np.repeat(np.arange(len(mesh.faces)), 3)
        self._x = mesh.vertices.copy()
        self._taken = np.zeros(len(mesh.vertices), np.bool_)
        self._ways: list[NDArray[np.int64]] = []
        self._numbers: list[int] = []  # of the line that each way is a part of

    def follow(self, number: int, line: FloatArray, name: str) -> None:
        """Add a line with this number."""
        line = _evenly(line, _SAMPLES * self._edge)
        if self._taken[self._anchors(line[-1])].any() and not self._taken[self._anchors(line[0])].any():
            line = line[::-1]  # begun where it is known on which of two sheets in touch it lies
        start = self._anchors(line[0])[0]
        closed = np.linalg.norm(line[-1] - line[0]) < _NEAR * self._edge and len(line) > _LOOP / _SAMPLES
        stops = self._crossed(line)
        if closed and not stops:  # a loop is followed in three parts, so that each has one shortest way
            third = len(line) // 3
            stops = [(self._nearest(line[k]), k) for k in (third, 2 * third)]
        ends = np.array([start]) if closed else self._anchors(line[-1])
        one, first = int(start), 0
        for other, last in [*((np.array([k]), at) for k, at in stops), (ends, len(line) - 1)]:
            if (other != one).all():
                one = self._between(line[first : last + 1], one, other, name)
                self._numbers.append(number)
                first = last

    def _crossed(self, line: FloatArray) -> list[tuple[int, int]]:
        """Return vertices of other lines that a line crosses, not those it runs beside, and where along it."""
        margin = int(2 * _NEAR / _SAMPLES)
        found = []
        for way in self._ways:
            apart = cdist(self._x[way], line)
            vertex, at = np.unravel_index(int(apart.argmin()), apart.shape)
            inner = margin < at < len(line) - margin and apart[vertex, at] < _CROSSED * self._edge
            if inner and apart[:, [at - margin, at + margin]].min() > self._edge:
                found.append((int(way[vertex]), int(at)))
        return sorted(set(found), key=lambda one: one[1])

    def _anchors(self, point: FloatArray) -> NDArray[np.int64]:
        """Return vertices for an end of a line, the nearest first: of other lines and rims, or else of all."""
        apart = np.linalg.norm(self._x - point, axis=1)
        order = np.argsort(apart, kind="stable")[:200]
        near = order[apart[order] < _NEAR * self._edge]
        meant = near[(self._taken | self._rim)[near]]
        if len(meant):
            return np.asarray(meant)
        return np.asarray(order[:1])

    def _nearest(self, point: FloatArray) -> int:
        return int(np.linalg.norm(self._x - point, axis=1).argmin())

    def _between(self, line: FloatArray, start: int, ends: NDArray[np.int64], name: str) -> int:
        """Add the way along a line from a vertex to whichever of others it leads to best; return that."""
        off, at = cKDTree(line).query(self._x)
        a, b = self._pairs.T
        free = ~self._taken
        free[start] = True
        free[ends] = True
        usable = free[a] & free[b] & (np.maximum(off[a], off[b]) < _LOST * self._edge) & ~(self._rim[a] & self._rim[b])
        dearer = _AWAY * (0.5 * (off[a] + off[b]) / self._edge) ** 2
        cost = (self._lengths * (1.0 + dearer))[usable]
        count = len(self._x)
        graph = coo_array((cost, (a[usable], b[usable])), shape=(count, count)).tocsr()
        far, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
        apart = np.linalg.norm(self._x[ends] - line[-1], axis=1)
        end = int(ends[int((far[ends] + _AWAY * apart).argmin())])
        if not np.isfinite(far[end]):
            x, y, z = line[len(line) // 2]
            problem = f"{name}: the surface has no way along it near ({x:.3f}, {y:.3f}, {z:.3f}) m"
            raise GarmentError(problem, hint="its points have to lie on the garment, in metres, in order")
        way = [end]
        while way[-1] != start:
            way.append(int(before[way[-1]]))
        path = self._without_detours(way[::-1])
        for vertex, point in ((start, line[0]), (end, line[-1])):
            self._slide(vertex, point)
        self._ways.append(path)
        self._taken[path] = True
        self._onto(path, line, at)
        return end

    def _slide(self, vertex: int, point: FloatArray) -> None:
        """Move a vertex where a line begins or ends to that end: along its rim, or along the one line it is on."""
        on = [way for way in self._ways if (way == vertex).any()]
        if self._rim[vertex] and not on:
            a, b = self._pairs[self._rim_edges].T
            around = np.concatenate([b[a == vertex], a[b == vertex]])
        elif len(on) == 1 and not self._rim[vertex] and vertex not in on[0][[0, -1]]:
            k = int(np.flatnonzero(on[0] == vertex)[0])
            around = on[0][[k - 1, k + 1]]
        elif on or self._rim[vertex]:
            return  # where lines meet already, or meet a rim
        else:
            self._x[vertex] = self._on_surface(np.array([vertex]), point[None])[0]
            return
        here = self._x[vertex]
        sides = self._x[around] - here
        share = np.clip((sides @ (point - here)) / (sides**2).sum(axis=1), 0.0, _SLID)
        places = here + share[:, None] * sides
        self._x[vertex] = places[int(np.linalg.norm(places - point, axis=1).argmin())]

    def _without_detours(self, way: list[int]) -> NDArray[np.int64]:
        """Return a way none of whose corners is in one triangle with both its neighbours, for others to start there."""
        k = 1
        while k < len(way) - 1:
            if (
                way[k + 1]
                in self._around.indices[self._around.indptr[way[k - 1]] : self._around.indptr[way[k - 1] + 1]]
            ):
                del way[k]
                k = max(k - 1, 1)
            else:
                k += 1
        return np.array(way)

    def _onto(self, path: NDArray[np.int64], line: FloatArray, at: NDArray[np.int64]) -> None:
        """Move the vertices of a way onto the line, in order; its ends go where the line has them but stay on rims."""
        inner = path[1:-1]
        if len(inner) == 0:
            return
        last = len(line) - 1.0
        room = _GAP * last / (len(path) - 1) * np.arange(1, len(path) - 1)
        place = isotonic_regression(at[inner] - room).x + room  # in order, and each near where it was
        place = np.clip(place, room[0], last - room[0])
        padded = np.concatenate([[0.0], place, [last]])
        place = 0.25 * padded[:-2] + 0.5 * place + 0.25 * padded[2:]
        number = np.arange(len(line))
        target = np.stack([np.interp(place, number, line[:, k]) for k in range(3)], axis=1)
        self._x[inner] = self._on_surface(inner, target)

    def _on_surface(self, vertex: NDArray[np.int64], target: FloatArray) -> FloatArray:
        """Return the places on the surface (N, 3) that vertices come to on their way to targets (N, 3)."""
        face = self._walk.follow(self._mesh.vertices[vertex], self._face[vertex], target)
        weights, _ = self._walk.nearest_on(target, face)
        return np.asarray(np.einsum("nk,nkd->nd", weights, self._mesh.vertices[self._mesh.faces[face]]))

    def seam(self) -> IntArray:
        """Return which line each half-edge is on, both sides of an edge, shape (3F,); -1: none."""
        count = len(self._x)
        halves = np.sort(half_edges(self._mesh).astype(np.int64), axis=1)
        key = halves[:, 0] * count + halves[:, 1]
        seam = np.full(len(key), -1, np.int32)
        for number, way in zip(self._numbers, self._ways, strict=True):
            ends = np.sort(np.stack([way[:-1], way[1:]], axis=1), axis=1)
            seam[np.isin(key, ends[:, 0] * count + ends[:, 1])] = number
        return seam

    def relaxed(self) -> TriangleMesh:
        """Return the mesh with vertices near lines moved along with them, on the surface.

        Raises:
            GarmentError: no room is found: a triangle is flipped.
        """
        mesh, x = self._mesh, self._x.copy()
        near = self._taken.copy()
        a, b = edges(mesh).T
        for _ in range(_RINGS):
            wider = near.copy()
            wider[a[near[b]]] = True
            wider[b[near[a]]] = True
            near = wider
        free = near & ~self._taken & ~self._rim
        if not self._ways or not free.any():
            return replace(mesh, vertices=x)
        mean = neighbour_mean(mesh)[free]
        moved = x - mesh.vertices
        for _ in range(_ROUNDS):
            moved[free] = mean @ moved
        x[free] = self._on_surface(np.flatnonzero(free), (mesh.vertices + moved)[free])
        found = replace(mesh, vertices=x)
        turned = np.einsum("fd,fd->f", face_area_vectors(found), face_area_vectors(mesh)) <= 0.0
        if turned.mean() > 0.01:
            raise GarmentError(
                f"drawn seams fold {int(turned.sum())} triangles", hint="lines closer than the mesh is fine: refine it"
            )
        return found


def _evenly(line: FloatArray, spacing: float) -> FloatArray:
    """Return points about one spacing apart along a polyline, its ends kept."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    places = np.linspace(0.0, at[-1], max(2, int(np.ceil(at[-1] / spacing)) + 1))
    return np.stack([np.interp(places, at, line[:, k]) for k in range(3)], axis=1)
