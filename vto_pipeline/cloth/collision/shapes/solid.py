"""Contacts with an analytic solid."""

from __future__ import annotations

import numpy as np
from numba import njit

from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan, surface_contacts
from vto_pipeline.cloth.collision.shapes.pose import Pose
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.solids import first_touch, signed_distance
from vto_pipeline.numerics.vector import axpy, dot, load, norm, store, sub

_TOUCHES = 1.5  # skins: what is nearer, touches

SLOW = 0.5
"""Of the skin: what moves no farther in a span cannot come through, nor need be foreseen."""


def solid_contacts(
    kind: int,
    size: tuple[float, float, float, float],
    where: Pose,
    friction: float,
    positions: FloatArray,
    span: ContactSpan,
) -> Contacts:
    """Return contacts with a solid at rest.

    Args:
        kind, size: As in `numerics.solids`.
        where: Its pose.
        friction: Coulomb coefficient.
        positions: Of the cloth [m], shape (V, 3).
        span: For which they hold.
    """
    move = np.zeros_like(positions) if span.move is None else where.own_direction(span.move)
    distance, point, normal, near = _planes(kind, size, where.own(positions), move, span.skin, span.travel)
    point, normal = where.world(point), where.world_direction(normal)
    return surface_contacts(distance, np.stack([point, point], 1), np.stack([normal, normal], 1), near, friction, span)


@njit(cache=True, error_model="numpy")
def glides(distance, sinking, skin):
    """Return whether a vertex that touches goes along the surface, so that its plane is that of the middle of its path.

    The plane of its begin would lead it off a curved surface, and what pulls it back there is work lost; that of its
    end, which it may not reach, would lift it. In the middle the two make up for each other.

    Args:
        distance: To the surface [m].
        sinking: Along the normal, of its path [m].
        skin: Distance to keep [m].
    """
    return 0.0 < distance < _TOUCHES * skin and abs(sinking) < 0.5 * distance


@njit(cache=True, error_model="numpy")
def _planes(kind, size, positions, move, skin, travel):  # type: ignore[no-untyped-def]
    """Return distance from the plane (V,), point and normal (V, 3), and whether there is a plane (V,)."""
    count = len(positions)
    distance = np.empty(count)
    point, normal = np.empty((count, 3)), np.empty((count, 3))
    near = np.zeros(count, np.bool_)
    for i in range(count):
        p, way = load(positions, i), load(move, i)
        d, q, n = signed_distance(kind, size, p)
        length = norm(way)
        near[i] = d < skin[i] + travel + length
        if glides(d, dot(n, way), skin[i]):
            _, there, ahead = signed_distance(kind, size, axpy(0.5, way, p))
            room = dot(ahead, sub(p, there))
            if room > 0.0:  # else the way leads over an edge, and the vertex may stay on this side of it
                d, q, n = room, there, ahead
        elif near[i] and d > 0.0 and length > SLOW * skin[i] and d + dot(n, way) < skin[i]:
            d, q, n = first_touch(kind, size, p, way)
        distance[i] = d
        store(point, i, q)
        store(normal, i, n)
    return distance, point, normal, near
