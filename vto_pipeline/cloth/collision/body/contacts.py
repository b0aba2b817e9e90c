"""Contacts of the cloth with a triangle-mesh body that may move."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.clean import clean_faces
from vto_pipeline.cloth.collision.body.crease import other_flank
from vto_pipeline.cloth.collision.body.nearest import Nearest, SurfaceTree
from vto_pipeline.cloth.collision.body.ray_march import march
from vto_pipeline.cloth.collision.body.triangle_planes import INSIDE, OUTSIDE, RIM, sides, triangle_planes
from vto_pipeline.cloth.collision.body.visible import Touchable, touchable
from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan, surface_contacts
from vto_pipeline.cloth.collision.shapes.solid import SLOW
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.pseudonormals import Pseudonormals, pseudonormals, update_pseudonormals

_SURELY = (
    0.55  # winding number above which a point is inside an open body; straight behind an open sheet it is one half
)
_BESIDE = 1.5  # skins: the other flank of a crease that is farther is not touched yet
_FAR = 1e6  # m; the first search has no limit, since cloth may start anywhere in the body


class _Surface(NamedTuple):
    """The surface of a body at its current position.

    Args:
        faces, normals: All of it.
        searched: What can be touched of it.
        part: How that lies on the whole, while the body rests and parts of it are inside others.
        judge: Of inside and outside, where normals cannot tell; None if they always can.
    """

    faces: IntArray
    normals: Pseudonormals
    searched: SurfaceTree
    part: Touchable | None = None
    judge: SurfaceDistance | None = None

    def on_body(self, found: Nearest) -> Nearest:
        """Map places on the touchable part to the whole surface."""
        return found if self.part is None else self.part.on_body(found)


class Recollection(NamedTuple):
    """What a search for contacts leaves for the next, of each vertex of the cloth.

    Args:
        guess, flank: Nearest face of the body, and of the other flank of a crease; -1 for none, shape (V,).
        distance: To the body, negative inside [m], shape (V,).
        first: Normal of the first of its planes, shape (V, 3).
    """

    guess: NDArray[np.int32]
    distance: FloatArray
    flank: NDArray[np.int32]
    first: FloatArray


class BodyCollider:
    """A moving body: keyframes spread evenly over `seconds`, then at rest.

    Keeps what makes the next search cheap: the tree, and for each cloth vertex the last triangle and distance. The
    body need not be clean (`clean`). What lies inside its other parts is no surface to it while it rests (`visible`).
    Where it has holes, rims or branches, a vertex is inside where the winding number then surely says so: behind a
    single sheet is not inside.

    Args:
        body: The keyframes.
        seconds: How long the motion takes [s].
        friction: Coulomb coefficient.
        job: For what was repaired and left out; with `force_all` the tree is refitted though nothing moved.

    Attributes:
        refits_left_out: How often contacts were found without a refit, since the body is at rest.
    """

    def __init__(self, body: MovingBody, seconds: float, friction: float, job: Job | None = None) -> None:
        self._frames = body.keyframes
        self._seconds = seconds
        self._friction = friction
        self._job = job or Job()
        self.refits_left_out = 0
        self._clean = clean_faces(self._frames, body.faces)
        if str(self._clean):
            self._job.note(f"body: {self._clean}")
        self._guess: np.ndarray = np.empty(0, np.int32)
        self._distance: FloatArray = np.empty(0)
        self._flank: np.ndarray = np.empty(0, np.int32)
        self._first: FloatArray = np.empty((0, 3))
        self._fitted_to = self.at(0.0)
        self._at_rest = not self._changes()
        self._surface = self._rest_surface() if self._at_rest else self._full_surface()
        if self._at_rest and not self._job.force_all:
            self._job.leave_out("refitting the body's tree", "the body is at rest")

    def at(self, time: float) -> FloatArray:
        """Return the body's vertices at a time [s], shape (V, 3) [m]."""
        frames = self._frames
        if len(frames) == 1 or self._seconds <= 0.0 or time >= self._seconds:
            return frames[-1].copy()  # writable like the rest, or Numba compiles everything twice
        place = max(time, 0.0) / self._seconds * (len(frames) - 1)
        first = int(place)
        return frames[first] + (place - first) * (frames[first + 1] - frames[first])

    def _changes(self) -> bool:
        """Return whether it moves at all."""
        return len(self._frames) > 1 and bool(np.ptp(self._frames, axis=0).any())

    @property
    def moves(self) -> bool:
        """Whether it ever does."""
        return not self._at_rest

    @property
    def faces(self) -> IntArray:
        """Its faces after cleaning, shape (F, 3)."""
        return self._clean.faces

    @property
    def count(self) -> int:
        """How many vertices it has."""
        return self._frames.shape[1]

    @property
    def friction(self) -> float:
        """Coulomb coefficient."""
        return self._friction

    @property
    def touchable_faces(self) -> NDArray[np.bool_]:
        """Which faces can be touched, shape (F,)."""
        shown = np.ones(len(self.faces), np.bool_)
        if self._surface.part is not None:
            shown[:] = False
            shown[self._surface.part.parent] = True
        return shown

    def nearest_faces(self, count: int) -> IntArray:
        """Return the face nearest to each of this many vertices when contacts were last found; -1 for none, at rest."""
        known = len(self._guess) == count and not self._at_rest
        return self._guess if known else np.full(count, -1, np.int32)

    def contained_vertices(self, count: int) -> NDArray[np.bool_]:
        """Return which vertices of a cloth of this many were inside when contacts were last found, shape (count,)."""
        known = len(self._distance) == count
        return self._distance < 0.0 if known else np.zeros(count, np.bool_)

    @property
    def refits_saved_s(self) -> float:
        """Time that the refits left out would have taken, by one that is made now [s]; 0 where there was none."""
        if self.refits_left_out == 0:
            return 0.0
        began = time.perf_counter()
        self._refit()
        return self.refits_left_out * (time.perf_counter() - began)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        before, after = self._fit(span)
        surface = self._surface
        shift = float(np.sqrt(((after - before) ** 2).sum(axis=1).max())) if after is not before else 0.0
        look = np.full(len(positions), span.travel + shift)
        if span.move is not None:
            look += np.linalg.norm(span.move, axis=1)
        if len(self._guess) != len(positions):
            self._guess = np.full(len(positions), -1, np.int32)
            self._distance = np.full(len(positions), -_FAR)
            self._flank, self._first = self._guess.copy(), np.zeros_like(positions)
        reach = np.maximum(span.skin, -self._distance + look) + look  # cloth inside must not be lost
        near = surface.searched.nearest(positions, reach, self._guess)
        found = surface.on_body(near)
        side, distance = self._sides(positions, before, found)
        outside = np.where(side == OUTSIDE, _BESIDE * span.skin, 0.0)
        flank = other_flank(surface.searched, positions, near, (self._flank, self._guess), outside)
        self._guess, self._distance = near.triangle, np.where(side == INSIDE, -distance, distance)
        self._flank = flank.triangle
        seen_from = positions
        if span.move is not None or after is not before:
            way = self._relative_motion(before, after, span, found)
            chosen = np.flatnonzero(self._may_tunnel(positions, before, span, side, found, way))
            place, ahead = march(surface.searched, positions[chosen], way[chosen], near.subset(chosen))
            ahead = surface.on_body(ahead)
            clear = _in_front_of_path_plane(
                positions[chosen], place, ahead.points_on(before, surface.faces), span.skin[chosen]
            )
            found = found.with_replaced(chosen[clear], ahead.subset(clear))
            seen_from = positions.copy()
            seen_from[chosen[clear]] = place[clear]

        def planes(seen_from: FloatArray, found: Nearest) -> Contacts:
            distance, point, normal, there = triangle_planes(
                before, after, surface.faces, surface.normals, positions, seen_from, side, *found
            )
            return surface_contacts(distance, point, normal, there, self._friction, span)

        nearest = planes(seen_from, found)
        if not (flank.triangle >= 0).any():
            self._first = nearest.normal[0, :, 0]
            return nearest
        return self._in_order(nearest, planes(positions, surface.on_body(flank)))

    def _in_order(self, nearest: Contacts, beside: Contacts) -> Contacts:
        """Return both flanks in the order of the last span, as contacts are remembered by their place."""
        normals = nearest.normal[0, :, 0], beside.normal[0, :, 0]
        like, unlike = (np.einsum("ij,ij->i", normal, self._first) for normal in normals)
        turned = beside.active[0] & (unlike > like)
        both = Contacts(*(np.concatenate(parts) for parts in zip(nearest, beside, strict=True)))
        for part in both[:4]:
            part[:, turned] = part[::-1, turned]
        self._first = both.normal[0, :, 0]
        return both

    def _sides(self, positions: FloatArray, before: FloatArray, found: Nearest) -> tuple[NDArray[np.int8], FloatArray]:
        """Return the side of the body each vertex is on, and its distance [m]."""
        surface = self._surface
        side, distance = sides(before, surface.faces, surface.normals, positions, *found)
        if surface.judge is not None:
            doubtful = np.zeros(len(side), np.bool_)
            if not self._clean.sealed:
                doubtful |= (side == INSIDE) | (side == RIM)
            if surface.part is not None:  # where two parts meet, the normal of one does not tell
                doubtful |= surface.part.passing[found.triangle] & (found.triangle >= 0)
            side[doubtful] = np.where(surface.judge.inside(positions[doubtful], _SURELY), INSIDE, OUTSIDE)
        return side, distance

    def _relative_motion(self, before: FloatArray, after: FloatArray, span: ContactSpan, found: Nearest) -> FloatArray:
        """Return the motion of each vertex relative to its nearest place on the body [m], shape (V, 3)."""
        way = np.zeros((len(found.triangle), 3)) if span.move is None else span.move
        if after is before:
            return way
        carried = found.points_on(after - before, self._surface.faces)
        return way - np.where((found.triangle >= 0)[:, None], carried, 0.0)

    def _may_tunnel(
        self,
        positions: FloatArray,
        before: FloatArray,
        span: ContactSpan,
        side: NDArray[np.int8],
        found: Nearest,
        way: FloatArray,
    ) -> NDArray[np.bool_]:
        """Return which vertices go far, and beyond the plane of the nearest place, shape (V,)."""
        away = positions - found.points_on(before, self._surface.faces)
        distance = np.linalg.norm(away, axis=1)
        beyond = distance**2 + np.einsum("ij,ij->i", away, way) < span.skin * distance
        far = np.linalg.norm(way, axis=1) > SLOW * span.skin
        return np.asarray((side == OUTSIDE) & (found.triangle >= 0) & far & beyond)

    def _refit(self) -> None:
        """Refit the tree to the current position."""
        vertices, faces, tree = self._surface.searched
        bvh.refit(tree, vertices, faces)

    def _fit(self, span: ContactSpan) -> tuple[FloatArray, FloatArray]:
        """Return the vertices at start and end of a span, with the surface fitted to the start."""
        if self._at_rest:
            if self._job.force_all:
                self._refit()
            else:
                self.refits_left_out += 1
            return self._fitted_to, self._fitted_to
        before = self.at(span.start)
        if span.start >= self._seconds:
            self._at_rest, self._fitted_to, self._guess = True, before, np.empty(0, np.int32)
            self._surface = self._rest_surface()
            return before, before
        if not np.array_equal(before, self._fitted_to):
            faces, normals, searched = self._surface[:3]
            bvh.refit(searched.tree, before, faces)
            update_pseudonormals(normals, before, faces)
            self._surface = self._surface._replace(searched=searched._replace(vertices=before))
            self._fitted_to = before
        return before, self.at(span.end)

    def _full_surface(self) -> _Surface:
        vertices, faces = self._fitted_to, self._clean.faces
        return _Surface(faces, pseudonormals(vertices, faces), SurfaceTree(vertices, faces, bvh.build(vertices, faces)))

    def _rest_surface(self) -> _Surface:
        """Return the body at rest, without the parts that cannot be touched."""
        found = self._touchable_surface()
        if found.part is not None:
            self._job.note(
                f"body: {found.part.buried} faces lie inside its other parts and cannot be touched, "
                f"{int(found.part.passing.sum())} faces pass through others"
            )
        return found

    def _touchable_surface(self) -> _Surface:
        """Return the body where it was last fitted to, without the parts that cannot be touched there."""
        whole = self._full_surface()
        mesh = TriangleMesh(self._fitted_to, whole.faces)
        distance = SurfaceDistance(mesh)
        part = touchable(mesh, distance)
        if part.buried or part.passing.any():
            searched = SurfaceTree(part.vertices, part.faces, bvh.build(part.vertices, part.faces))
            return whole._replace(searched=searched, part=part, judge=distance)
        return whole if self._clean.sealed else whole._replace(judge=distance)


def _in_front_of_path_plane(
    positions: FloatArray, place: FloatArray, on: FloatArray, skin: FloatArray
) -> NDArray[np.bool_]:
    """Return which vertices are before the plane through a point that faces a place on their path, shape (N,)."""
    normal = place - on
    room = np.einsum("ij,ij->i", positions - on, normal)
    return np.asarray(room >= SLOW * skin * np.linalg.norm(normal, axis=1))
