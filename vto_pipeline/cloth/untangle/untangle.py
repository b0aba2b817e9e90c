"""Untangling of a bad start: cloth that crosses itself or a body is moved as little as needed.

Each round finds the crossings exactly, asks the flood for each contour which part has come through, and where that
cannot be told, which way the contour shortens; turns both into rows, and relaxes the cloth to them without stretching
it. Where rounds bring nothing more, the cloth about the crossings is smoothed, which takes kinks out. The best round
counts: the result never has more pairs than the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.collision.self_collision.surface_features import features
from vto_pipeline.cloth.untangle.body import OutermostFaces
from vto_pipeline.cloth.untangle.contours import Crossings, contours, crossings
from vto_pipeline.cloth.untangle.flood import mesh_graph
from vto_pipeline.cloth.untangle.near import near_rows
from vto_pipeline.cloth.untangle.push import push_rows
from vto_pipeline.cloth.untangle.relax import (
    length_bounds,
    length_violation,
    project_rows_and_lengths,
    with_kinks_opened,
)
from vto_pipeline.cloth.untangle.rows import SeparationRows, concatenate_rows
from vto_pipeline.cloth.untangle.smooth import smoothed
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.laplace import laplacian
from vto_pipeline.geometry.topology import surface_area
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.spatial import bvh

_STEP = 0.5  # of the mean edge: how far a round pushes by default
_SWEEPS = 20  # of the relaxation, each round
_PATIENCE = 24  # rounds without a better one
_KINKED = 4  # such rounds after which the cloth about the crossings is smoothed, and again after as many
_GROWTH = 0.01  # of the area: a round that stretches the cloth more does not count
_PRESSED = 0.3  # share of its shortage that a pressed bar regains in a sweep: cloth folds sooner than it stretches
_RECOVERY = 4  # rounds at most in which the untangled cloth gets its lengths back: three do for ninety bad starts
_RECOVERED = 0.98  # of what is missing: a round must leave less than this to be followed by another


@dataclass(frozen=True)
class Untangled:
    """A cloth that no longer passes through anything, or the best that was found.

    Args:
        positions: [m], shape (V, 3).
        pairs: Faces of the cloth that still meet each other, shape (K, 2).
        body_pairs: Faces (cloth, body) that still meet, shape (L, 2).
        places: Points of each contour that is left [m], shape (N, 3) each: what is to be drawn.
        rounds: Until this was found.
        area_growth: Against the start, relative.
    """

    positions: FloatArray
    pairs: IntArray
    body_pairs: IntArray
    places: tuple[FloatArray, ...]
    rounds: int
    area_growth: float

    @property
    def crossings_left(self) -> int:
        """Pairs of faces that still meet."""
        return len(self.pairs) + len(self.body_pairs)


def untangle(
    positions: FloatArray,
    faces: IntArray,
    *,
    body: TriangleMesh | None = None,
    rest: FloatArray | None = None,
    thickness: float,
    step: float | None = None,
    rounds: int = 100,
    job: Job | None = None,
) -> Untangled:
    """Move a cloth until no triangle of it meets another, nor the body.

    Deterministic, geometric and static: no forces, no time. Cloth that is wholly inside a body is not for it.

    Args:
        positions: Of the cloth [m], shape (V, 3).
        faces: Shape (F, 3); a manifold with boundary, neighbours oriented alike.
        body: May be open and cross itself.
        rest: The cloth's shape without forces [m], shape (V, 3), to whose lengths it may return; by default the start.
        thickness: Gap to leave where something was moved [m].
        step: How far a round pushes [m]; by default half of the mean edge. In a narrow fold, less than its room.
        rounds: At most.
        job: For progress, and a warning if something is left.

    Returns:
        The best that was found. Whatever is left is named.
    """
    job = job or Job()
    start = TriangleMesh(positions, faces)
    work = _UntangleProblem(start, body, positions if rest is None else rest, thickness, step)
    x = np.array(positions, dtype=np.float64)
    best = tangle = work.find_crossings(x)
    best_round, began = 0, best.count
    if not began:
        job.leave_out("untangling the start", "no triangles intersect")
    for k in range(1, rounds + 1):
        stalled = k - 1 - best_round
        if best.count == 0 or stalled > _PATIENCE:
            break
        if stalled and stalled % _KINKED == 0:
            tangle = work.find_crossings(work.smoothed(tangle, stalled // _KINKED))
        tangle = work.find_crossings(work.pushed(tangle))
        if tangle.count < best.count and work.area_growth(tangle.positions) <= _GROWTH:
            best, best_round = tangle, k
        job.progress(1.0 - best.count / began, f"untangling: {best.count} of {began} pairs of triangles left")
    if best_round:
        best = work.recovered(best)
    places = work.places(best)
    if best.count:
        shown = ", ".join("({:.3f}, {:.3f}, {:.3f})".format(*points.mean(axis=0)) for points in places[:5])
        job.warn(f"{best.count} of {began} pairs of triangles still intersect at the start, near {shown}")
    return Untangled(best.positions, best.pairs, best.body_pairs, places, best_round, work.area_growth(best.positions))


@dataclass(frozen=True)
class _Crossing:
    """A cloth and what of it meets: see `Untangled`."""

    positions: FloatArray
    pairs: IntArray
    body_pairs: IntArray

    @property
    def count(self) -> int:
        return len(self.pairs) + len(self.body_pairs)


class _UntangleProblem:
    """What does not change from round to round."""

    def __init__(
        self, start: TriangleMesh, body: TriangleMesh | None, rest: FloatArray, thickness: float, step: float | None
    ) -> None:
        self._faces = start.faces.copy()
        self._features = features(start.faces, len(start.vertices))
        self._tree = bvh.build(start.vertices.copy(), self._features.faces)
        self._bars = length_bounds(start, rest)
        self._laplacian, area = laplacian(start)
        self._sheet = mesh_graph(self._features.edges, area)
        self._area = surface_area(start)
        self._body = body
        self._walls = None if body is None else OutermostFaces(body)
        self._thickness = thickness
        ends = start.vertices[self._features.edges]
        self._step = _STEP * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()) if step is None else step

    def find_crossings(self, positions: FloatArray) -> _Crossing:
        """Return what meets at these positions."""
        mesh = self._mesh(positions)
        outer = np.empty((0, 2), np.int32) if self._body is None else intersecting_faces(mesh, self._body)
        return _Crossing(positions, self_intersections(mesh), outer)

    def pushed(self, tangle: _Crossing) -> FloatArray:
        """Return the positions after a round."""
        x = tangle.positions
        crossing = crossings(x, self._faces, tangle.pairs)
        parts, pushed = push_rows(crossing, contours(crossing), self._sheet, x, self._thickness, self._step)
        parts += self._separation_rows(tangle, pushed)
        kinks = self._faces[tangle.pairs[(crossing.ends < 0).any(axis=1)]]
        return project_rows_and_lengths(
            x, concatenate_rows(parts), with_kinks_opened(self._bars, kinks, len(x)), _SWEEPS, _PRESSED
        )

    def smoothed(self, tangle: _Crossing, rings: int) -> FloatArray:
        """Return the positions with the surroundings of all crossings smoothed."""
        met = np.concatenate([self._faces[tangle.pairs].ravel(), self._faces[tangle.body_pairs[:, 0]].ravel()])
        return smoothed(tangle.positions, self._laplacian, met, rings)

    def recovered(self, tangle: _Crossing) -> _Crossing:
        """Return the cloth with its lengths as far back as goes without new pairs."""
        nothing, pressed = np.zeros(len(tangle.positions), np.bool_), 1.0
        for _ in range(_RECOVERY):
            parts = self._separation_rows(tangle, nothing)
            found = self.find_crossings(
                project_rows_and_lengths(tangle.positions, concatenate_rows(parts), self._bars, _SWEEPS, pressed)
            )
            short, before = self._short(found), self._short(tangle)
            if found.count > tangle.count or short >= before or self.area_growth(found.positions) > _GROWTH:
                pressed *= 0.5
                continue
            tangle = found
            if short > _RECOVERED * before:
                break
        return tangle

    def places(self, tangle: _Crossing) -> tuple[FloatArray, ...]:
        """Return the points of each contour."""
        made = crossings(tangle.positions, self._faces, tangle.pairs), self._with_body(tangle)
        return tuple(
            crossing.point[part]
            for crossing in made
            if crossing is not None
            for chain in [contours(crossing)]
            for part in np.split(chain.order, chain.first[1:-1])
            if len(part)
        )

    def area_growth(self, positions: FloatArray) -> float:
        """Return by how much the area has grown, relative."""
        return surface_area(self._mesh(positions)) / self._area - 1.0

    def _separation_rows(self, tangle: _Crossing, pushed: np.ndarray) -> list[SeparationRows]:
        """Return the rows that keep things apart that are, and lead out of the body."""
        x = tangle.positions
        parts = near_rows(self._tree, self._features, x, self._thickness + self._step, self._thickness, pushed)
        crossing = self._with_body(tangle)
        if self._walls is not None and crossing is not None:
            parts += self._walls.rows(x, crossing, self._thickness, self._step)
        return parts

    def _with_body(self, tangle: _Crossing) -> Crossings | None:
        if self._body is None:
            return None
        count = len(tangle.positions)
        return crossings(
            np.vstack([tangle.positions, self._body.vertices]),
            np.vstack([self._faces, self._body.faces + np.int32(count)]),
            tangle.body_pairs + np.array([0, len(self._faces)], np.int32),
        )

    def _short(self, tangle: _Crossing) -> float:
        return length_violation(tangle.positions, self._bars)

    def _mesh(self, positions: FloatArray) -> TriangleMesh:
        return TriangleMesh(positions, self._faces)
