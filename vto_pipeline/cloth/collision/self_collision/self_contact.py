"""A cloth, itself and bodies: what to keep apart in a step, and how far the step may go. Knows no solver."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.self_collision.body_features import BodyFeatures, Candidates, no_candidates
from vto_pipeline.cloth.collision.self_collision.candidates import self_candidates, still_overlap
from vto_pipeline.cloth.collision.self_collision.counters import CollisionCounters
from vto_pipeline.cloth.collision.self_collision.pairs import Pairs, against_bodies, near_pairs, no_pairs, owners
from vto_pipeline.cloth.collision.self_collision.pieces import surface_components
from vto_pipeline.cloth.collision.self_collision.proximity_bound import prove_separation
from vto_pipeline.cloth.collision.self_collision.safe_step import collision_free_step
from vto_pipeline.cloth.collision.self_collision.surface_features import features
from vto_pipeline.geometry.intersections import meeting_vertices, self_intersections
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.units import GRAVITY

_RECOVERY = 0.1  # m/s: speed at which layers nearer than their thickness are led apart
_REGAINED = 0.2  # of a gap that is lost, at most, in a step: at once, layers would be thrown apart
_ROOM = 0.1  # of an edge: the most that layers are looked for beyond their thickness, or none could be proven apart
_LOOK = 50  # searches after which to see whether the tree is still good, and what has come free
_WIDER = 0.3  # of the longest way: how much farther than asked for a search looks, to serve the rest of the step too;
# of an edge at most: a single vertex that a trial flings must not make everything near everything
_ASLEEP = 0.3  # of the reach: but at least so much, so that what hardly moves is not searched for at each step


class _CachedCandidates(NamedTuple):
    """Candidates, good while all vertices stay between these places [m], shape (V, 3)."""

    candidates: Candidates
    low: FloatArray
    high: FloatArray

    def covers(self, x: FloatArray, end: FloatArray, radius: FloatArray) -> bool:
        """Return whether these paths, with their radii, stay there."""
        if len(self.low) != len(x):
            return False
        low, high = _swept_bounds(x, end, radius)
        return bool((low >= self.low).all() and (high <= self.high).all())


class _VerifiedMove(NamedTuple):
    """A move from x to end [m], shapes (V, 3), on which nothing meets; this many pairs were looked at to know it."""

    x: FloatArray
    end: FloatArray
    pairs: int


_NOTHING = _CachedCandidates(no_candidates(), np.empty((0, 3)), np.empty((0, 3)))


class SelfContact:
    """Contacts of a cloth with itself, and with the features of bodies.

    Args:
        faces: Shape (F, 3).
        reach: Half the distance each vertex keeps from the rest of the cloth [m], shape (V,).
        friction: Coulomb coefficient, cloth against cloth: one, or of each vertex, shape (V,).
        bodies: From which the cloth keeps its reach between its vertices, too.
        at_once: Whether what is too near is to keep all its distance by the end of a step, as where contacts give way.
        crossed: Vertices of what crosses from the start, and takes no part until it is free, shape (V,).
        force_all: Search always, to compare.

    Attributes:
        counters: What was done.
    """

    def __init__(
        self,
        faces: IntArray,
        reach: FloatArray,
        friction: float | FloatArray,
        *,
        bodies: Sequence[BodyCollider] = (),
        at_once: bool = False,
        crossed: NDArray[np.bool_] | None = None,
        force_all: bool = False,
    ) -> None:
        self.counters = CollisionCounters()
        self._cloth = self._features = features(faces, len(reach))
        self._bodies: BodyFeatures | None = None
        self._reach = self._all_reach = reach
        self._friction = np.array(np.broadcast_to(friction, reach.shape), np.float64)
        if bodies:
            self._bodies = BodyFeatures(bodies, self._cloth, len(reach))
            self._features = self._bodies.features
            self._all_reach = np.concatenate([reach, np.zeros(len(self._bodies.friction))])
            self._friction = np.concatenate([self._friction, self._bodies.friction])
        self._owners = owners(self._features, len(self._all_reach))
        self._components = surface_components(faces, len(reach))
        self._crossed = np.zeros(len(reach), np.bool_) if crossed is None else crossed.copy()
        self._force_all = force_all
        self._recovery, self._regained = (np.inf, 1.0) if at_once else (_RECOVERY, _REGAINED)
        self._tree: bvh.Bvh | None = None
        self._length: float | None = None
        self._found = self._beside = _NOTHING
        self._passed: _VerifiedMove | None = None
        self._failed = self._wait = 0  # proofs since the last that was one; how often not to try

    @property
    def tangled(self) -> bool:
        """Whether cloth crosses itself, as it did from the start."""
        return bool(self._crossed.any())

    def set_time_span(self, begin: float, end: float) -> None:
        """Take the bodies to a step between these times [s]; what is asked next is about it."""
        self._passed = None
        if self._bodies is not None:
            self._bodies.set_time_span(begin, end)

    def find_pairs(self, x: FloatArray, end: FloatArray, seconds: float, drift: FloatArray | None = None) -> Pairs:
        """Return the pairs that are, or come by straight paths, nearer than they may; see `pairs.near_pairs`.

        So are those that come near where one falls and the other is held. Vertices before faces of a body are not among
        them: planes hold those, and farther away.

        Args:
            x, end: Positions at the start and where vertices would go by themselves [m], shape (V, 3).
            seconds: How long that takes [s].
            drift: How far by their speed alone [m], shape (V, 3); all the way when None.
        """
        apart = min(GRAVITY * seconds**2, _ROOM * self._edge(x))
        before = self.counters.reused
        found = self._candidates(x, _without_common_motion(x, end), 0.5 * apart)
        self.counters.rested += self.counters.reused - before
        if self._bodies is not None:
            found = found.concatenated(self._beyond_planes(self._body_candidates(self._bodies, x, end), len(x)))
        return self._pairs(x, end, end - x if drift is None else drift, found, self._recovery * seconds, apart, True)

    def _edge(self, x: FloatArray) -> float:
        """Return the median length of the cloth's edges when first asked [m]."""
        if self._length is None:
            ends = x[self._cloth.edges]
            self._length = float(np.median(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
        return self._length

    def collision_free(
        self, x: FloatArray, end: FloatArray, pushed: FloatArray | None = None
    ) -> tuple[FloatArray, Pairs]:
        """Return positions on the way to `end` that nothing crosses another on the way to, and what would have.

        Of a move from the same places that was found free before, only what has changed is looked at again.

        Before a moving body it is safest to be carried along: each vertex as what is beside it moves, or, where layers
        would meet by that, all alike. Where neither is safe, as between two bodies, the cloth is kept from passing
        through itself and what rests, and what meets is counted.

        Args:
            x, end: Positions at the start, where nothing crosses, and wanted [m], shape (V, 3).
            pushed: How far what has no features takes along each vertex that is in its way [m], shape (V, 3).
        """
        if self._crossed.any() and self.counters.asked % _LOOK == 0:
            self._release(x)
        new = np.ones(len(self._all_reach), np.bool_)
        if self._passed is not None and np.array_equal(x, self._passed.x):
            new[:] = False
            new[: len(x)] = (end != self._passed.end).any(axis=1)
            if not new.any():
                self.counters.impacts_known += self._passed.pairs
                return end, no_pairs()
        start, wanted, bodies = x, end, self._bodies
        beside = no_candidates()
        carried = pushed
        if bodies is not None:
            start, wanted = bodies.with_bodies(x, False), bodies.with_bodies(end, True)
            beside = self._body_candidates(bodies, x, end, bodies.step)
            if bodies.moving(beside).any():
                led = bodies.carried_displacement(beside)
                carried = led if pushed is None else np.where(led != 0.0, led, pushed)
        backs, room = [x], np.zeros(len(x))
        if carried is not None and carried.any():
            common = carried.sum(axis=0) / max(int(carried.any(axis=1).sum()), 1)
            backs = [x + carried, x + common]
            room = np.maximum(np.linalg.norm(carried, axis=1), np.linalg.norm(common))
        if bodies is not None:
            backs = [bodies.with_bodies(back, True) for back in backs]
        for ways in (_without_common_motion(x, end), end):  # what is cut short falls behind what all have in common
            found = self._candidates(x, ways, room).concatenated(beside)
            if found.size == 0:
                self._remember_verified(x, end, 0)
                return end, no_pairs()
            moving = np.zeros(found.size, np.bool_) if bodies is None else bodies.moving(found)
            began = time.perf_counter()
            for back in backs:
                there, share, hit, stuck, looked = self._collision_free_step(start, wanted, back, found, new)
                if not (stuck & ~moving).any():
                    break
            else:
                there, share, *_ = self._collision_free_step(start, wanted, start, found.subset(~moving), new)
                stuck = hit
            self.counters.impacts += looked
            self.counters.impacts_known += found.size - looked
            self.counters.impact_s += time.perf_counter() - began
            if (share == 1.0).all():
                self._remember_verified(x, end, found.size)
                break
        self.counters.uncut += int((stuck & moving).sum())
        self.counters.shortened += int((share[: len(x)] < 1.0).sum())
        return there[: len(x)], self._pairs(
            x, end, end - x, self._beyond_planes(found.subset(hit), len(x)), 0.0, 0.0, False
        )

    def _remember_verified(self, x: FloatArray, end: FloatArray, pairs: int) -> None:
        """Remember that nothing meets on the way from x to end."""
        if not self._force_all:
            self._passed = _VerifiedMove(x.copy(), end.copy(), pairs)

    def _collision_free_step(
        self, start: FloatArray, wanted: FloatArray, back: FloatArray, found: Candidates, new: NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.bool_], int]:
        """See `safe_step.collision_free_step`."""
        way: tuple[FloatArray, FloatArray, NDArray[np.bool_], NDArray[np.bool_], int]
        way = collision_free_step(start, wanted, back, self._features, *found, self._all_reach, new)
        return way

    def _beyond_planes(self, found: Candidates, count: int) -> Candidates:
        """Return those that are not of a vertex of the cloth and a face of a body: planes hold these."""
        held = (found.to_face[:, 0] < count) & (found.to_face[:, 1] >= len(self._cloth.faces))
        return found._replace(to_face=found.to_face[~held])

    def _release(self, x: FloatArray) -> None:
        """Let what no longer crosses anything take part."""
        faces = self._cloth.faces
        self._crossed &= meeting_vertices(self_intersections(TriangleMesh(x, faces)), faces, len(x))
        self._found, self._passed = _NOTHING, None  # what was found without them no longer holds

    def _pairs(
        self,
        x: FloatArray,
        end: FloatArray,
        drift: FloatArray,
        found: Candidates,
        recovery: float,
        apart: float,
        coming: bool,
    ) -> Pairs:
        if found.size == 0:
            return no_pairs()
        start, bodies = x, self._bodies
        if bodies is not None:
            start, end = bodies.with_bodies(x, False), bodies.with_bodies(end, True)
            drift = np.concatenate([drift, bodies.end - bodies.begin])
        pairs = near_pairs(
            start,
            end,
            drift,
            self._features,
            self._owners,
            *found,
            self._all_reach,
            recovery,
            self._regained,
            apart,
            self._friction,
            coming,
        )
        if bodies is None:
            return pairs
        return against_bodies(pairs, len(x), bodies.begin, bodies.end, bodies.friction)

    def _candidates(self, x: FloatArray, end: FloatArray, room: float | FloatArray = 0.0) -> Candidates:
        """Return candidates for paths that have in common what the vertices do not move, with room about them [m]."""
        self.counters.asked += 1
        radius = self._reach + room
        if not self._force_all:
            serves = self._found.covers(x, end, radius)
            nothing = serves and self._found.candidates.size == 0
            if not nothing and self._out_of_reach(x, end, radius, may_wait=serves):
                self.counters.out_of_reach += 1
                return no_candidates()
            if serves:
                self.counters.reused += 1
                return self._still_overlapping(self._found.candidates, x, end, radius)
        began = time.perf_counter()
        wider = self._search_radius(x, end) + room
        found = Candidates(*self_candidates(self._fitted(x, end, wider), self._cloth, x, end, wider, self._crossed))
        self._found = _CachedCandidates(found, *_swept_bounds(x, end, wider))
        self.counters.searched += 1
        self.counters.candidates = max(self.counters.candidates, found.size)
        self.counters.search_s += time.perf_counter() - began
        return self._still_overlapping(found, x, end, radius)

    def _out_of_reach(self, x: FloatArray, end: FloatArray, radius: FloatArray, *, may_wait: bool) -> bool:
        """Return whether it is proven that nothing comes near on these paths; what fails often may wait to be tried."""
        if may_wait and self._wait > 0:
            self._wait -= 1
            return False
        began = time.perf_counter()
        proof = prove_separation(self._components, x, end, radius)
        self.counters.proof_s += time.perf_counter() - began
        self._failed = 0 if proof.out else min(self._failed + 1, _LOOK)
        self._wait = max(self._failed - 1, 0)
        return proof.out

    def _still_overlapping(self, found: Candidates, x: FloatArray, end: FloatArray, radius: FloatArray) -> Candidates:
        """Return what of the candidates is one on these paths: what is left out must not change what is found."""
        return found.subset(still_overlap(self._cloth, *found, x, end, radius))

    def _body_candidates(self, bodies: BodyFeatures, x: FloatArray, end: FloatArray, room: float = 0.0) -> Candidates:
        """Return candidates between the cloth, with room about its paths [m], and what is outside it of bodies."""
        self.counters.body_asked += 1
        start, there = bodies.with_bodies(x, False), bodies.with_bodies(end, True)
        if self._force_all or not self._beside.covers(start, there, self._all_reach + room):
            began = time.perf_counter()
            wider = self._search_radius(x, end) + room
            found = bodies.search(self._fitted(x, end, wider), x, end, wider)
            padded = np.concatenate([wider, np.full(len(bodies.friction), room)])
            self._beside = _CachedCandidates(found, *_swept_bounds(start, there, padded))
            self.counters.body_searched += 1
            self.counters.body_s += time.perf_counter() - began
        found = self._beside.candidates
        found = found.subset(still_overlap(bodies.features, *found, start, there, self._all_reach + room))
        return bodies.approached_from_outside(found, x, end, self._reach + room)

    def _search_radius(self, x: FloatArray, end: FloatArray) -> FloatArray:
        """Return radii to search within, with room for the rest of the step and for rest [m], shape (V,)."""
        if self._force_all:
            return self._reach
        longest = min(float(np.sqrt(((end - x) ** 2).sum(axis=1).max(initial=0.0))), self._edge(x))
        return self._reach + max(_WIDER * longest, _ASLEEP * float(self._reach.max(initial=0.0)))

    def _fitted(self, x: FloatArray, end: FloatArray, radius: FloatArray) -> bvh.Bvh:
        """Return the tree over the cloth's faces on these paths."""
        faces = self._cloth.faces
        due = (self.counters.searched + self.counters.body_searched) % _LOOK == 0
        worn = due and self._tree is not None and bvh.degraded(self._tree, x, faces)
        if self._tree is None or worn:
            self._tree = bvh.build(x, faces)
        bvh.refit_swept(self._tree, x, end, faces, radius)
        return self._tree


def _swept_bounds(x: FloatArray, end: FloatArray, radius: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest places of vertices on their paths, with their radii [m], shapes (V, 3)."""
    return np.minimum(x, end) - radius[:, None], np.maximum(x, end) + radius[:, None]


def _without_common_motion(x: FloatArray, end: FloatArray) -> FloatArray:
    """Return the ends of the paths less what all have in common, which brings nothing nearer to anything."""
    return np.asarray(end - np.einsum("ij->j", end - x) / len(x))
