"""A body of triangles that may move: the cloth's contacts with it."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.contacts import Contacts, Round, ride
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.job import Job
from vto_pipeline.numerics import bvh
from vto_pipeline.numerics.distance import blend
from vto_pipeline.numerics.pseudonormals import feature_normal, pseudonormals, update
from vto_pipeline.numerics.vector import cross, dot, load, norm, scale, store, sub, unit

_FAR = 1e6  # m; the first search has no limit, since cloth may start anywhere in the body


class BodyCollider:
    """A moving body: keyframes spread evenly over `seconds`, then at rest.

    Keeps what makes the next search cheap: the tree, and for each cloth vertex the last triangle and distance.

    Args:
        body: The keyframes.
        seconds: How long the motion takes [s].
        friction: Coulomb coefficient.
        job: For what was left out; with `force_all` the tree is refitted though nothing moved.
    """

    def __init__(self, body: MovingBody, seconds: float, friction: float, job: Job | None = None) -> None:
        self._frames = body.keyframes
        self._faces = body.faces.copy()
        self._seconds = seconds
        self._friction = friction
        self._always_refit = job is not None and job.force_all
        self._fitted_to = self.at(0.0)
        self._tree = bvh.build(self._fitted_to, self._faces)
        self._normals = pseudonormals(self._fitted_to, self._faces)
        self._guess: np.ndarray = np.empty(0, np.int32)
        self._distance: FloatArray = np.empty(0)
        self._moves = len(self._frames) > 1 and bool(np.ptp(self._frames, axis=0).any())
        if not self._moves and not self._always_refit and job is not None:
            job.leave_out("refitting the body's tree", "the body is at rest")

    def at(self, time: float) -> FloatArray:
        """Return the body's vertices at a time [s], shape (V, 3) [m]."""
        frames = self._frames
        if len(frames) == 1 or self._seconds <= 0.0 or time >= self._seconds:
            return frames[-1].copy()  # writable like the rest, or Numba compiles everything twice
        place = max(time, 0.0) / self._seconds * (len(frames) - 1)
        first = int(place)
        return frames[first] + (place - first) * (frames[first + 1] - frames[first])

    def contacts(self, positions: FloatArray, span: Round) -> Contacts:
        """See `Collider.contacts`."""
        before = self.at(span.start)
        after = self.at(span.end) if self._moves else before
        if self._always_refit or (self._moves and not np.array_equal(before, self._fitted_to)):
            bvh.refit(self._tree, before, self._faces)
            update(self._normals, before, self._faces)
            self._fitted_to = before
        shift = float(np.sqrt(((after - before) ** 2).sum(axis=1).max())) if self._moves else 0.0
        look = span.travel + shift
        if len(self._guess) != len(positions):
            self._guess = np.full(len(positions), -1, np.int32)
            self._distance = np.full(len(positions), -_FAR)
        reach = np.maximum(span.skin, -self._distance + look) + look  # cloth inside must not be lost
        triangle, weights, feature = bvh.closest_points(self._tree, before, self._faces, positions, reach, self._guess)
        distance, point, normal, near = _planes(
            before, after, self._faces, self._normals, positions, triangle, weights, feature
        )
        self._guess, self._distance = triangle, distance
        return ride(distance, point, normal, self._friction, near, span)


@njit(cache=True)
def _planes(before, after, faces, normals, positions, triangle, weights, feature):  # type: ignore[no-untyped-def]
    """Return signed distance (V,), point and normal at begin and end (V, 2, 3), and whether there is a plane (V,)."""
    count = len(positions)
    distance = np.full(count, np.inf)
    point, normal = np.zeros((count, 2, 3)), np.zeros((count, 2, 3))
    near = np.zeros(count, np.bool_)
    for i in range(count):
        t = triangle[i]
        if t < 0:
            continue
        out = unit(feature_normal(normals, faces, t, feature[i]))
        if out == (0.0, 0.0, 0.0):  # over the rim of an open body there is no inside
            continue
        a, b, c = load(before, faces[t, 0]), load(before, faces[t, 1]), load(before, faces[t, 2])
        w = (weights[i, 0], weights[i, 1], weights[i, 2])
        on = blend(w, a, b, c)
        away = sub(load(positions, i), on)
        length = norm(away)
        sign = 1.0 if dot(away, out) >= 0.0 else -1.0
        n = scale(sign / length, away) if length > 1e-7 else out  # nearer, the direction is only rounding
        a1, b1, c1 = load(after, faces[t, 0]), load(after, faces[t, 1]), load(after, faces[t, 2])
        near[i] = True
        distance[i] = sign * length
        store(point[i], 0, on)
        store(point[i], 1, blend(w, a1, b1, c1))
        store(normal[i], 0, n)
        store(normal[i], 1, _turned(n, a, b, c, a1, b1, c1))
    return distance, point, normal, near


@njit(cache=True)
def _turned(n, a, b, c, a1, b1, c1):  # type: ignore[no-untyped-def]
    """Return direction n after triangle abc has moved to a1 b1 c1, turning with its edge ab and its normal."""
    u, z = unit(sub(b, a)), unit(cross(sub(b, a), sub(c, a)))
    u1, z1 = unit(sub(b1, a1)), unit(cross(sub(b1, a1), sub(c1, a1)))
    v, v1 = cross(z, u), cross(z1, u1)
    x, y, w = dot(n, u), dot(n, v), dot(n, z)
    turned = (
        x * u1[0] + y * v1[0] + w * z1[0],
        x * u1[1] + y * v1[1] + w * z1[1],
        x * u1[2] + y * v1[2] + w * z1[2],
    )
    return unit(turned) if norm(turned) > 0.5 else n
