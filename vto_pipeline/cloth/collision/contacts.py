"""Contacts as planes attached to a surface for a short time, the only form that solvers see."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.model.arrays import FloatArray


class Contacts(NamedTuple):
    """For each surface S and cloth vertex V, a plane the vertex must stay in front of.

    All vary linearly from the start (index 0) to the end (index 1) of the span they were made for.

    Args:
        active: Whether there is a plane, shape (S, V).
        point: On the surface [m], shape (S, V, 2, 3).
        normal: Out of the surface, unit, shape (S, V, 2, 3).
        offset: Distance to keep from the point along the normal [m], shape (S, V, 2). Negative where the cloth starts
            inside: it is led out, not thrown.
        friction: Coulomb coefficient of each surface, shape (S,).
    """

    active: NDArray[np.bool_]
    point: FloatArray
    normal: FloatArray
    offset: FloatArray
    friction: FloatArray


class ContactSpan(NamedTuple):
    """A short span of time for which contacts are found once.

    Args:
        start, end: [s].
        travel: No vertex moves farther in it [m].
        skin: Distance to keep from surfaces, of each vertex [m], shape (V,).
        recovery: Speed at which cloth inside a surface is led out [m/s]; infinite where contacts give way.
        move: Where each vertex is heading in the span, if known [m], shape (V, 3); a plane is then chosen that is not
            in its way unless the surface is.
    """

    start: float
    end: float
    travel: float
    skin: FloatArray
    recovery: float
    move: FloatArray | None = None


class Collider(Protocol):
    """A collider for cloth."""

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """Return the contacts of this surface alone with vertices at these positions [m], shape (V, 3)."""


def gather_contacts(colliders: Sequence[Collider], positions: FloatArray, span: ContactSpan) -> Contacts:
    """Return the contacts with all colliders."""
    if not colliders:
        return empty_contacts(len(positions))
    found = [collider.contacts(positions, span) for collider in colliders]
    if len(found) == 1:
        return found[0]
    return Contacts(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def without_friction(found: Contacts, loose: NDArray[np.bool_]) -> Contacts:
    """Return the contacts with those of some vertices, shape (V,), without friction, each surface twice for that."""
    point, normal, offset = (np.concatenate([part, part]) for part in (found.point, found.normal, found.offset))
    active = np.concatenate([found.active & ~loose, found.active & loose])
    return Contacts(active, point, normal, offset, np.concatenate([found.friction, np.zeros_like(found.friction)]))


def empty_contacts(count: int) -> Contacts:
    """Return no contact for this many vertices."""
    return Contacts(
        np.empty((0, count), np.bool_),
        np.empty((0, count, 2, 3)),
        np.empty((0, count, 2, 3)),
        np.empty((0, count, 2)),
        np.empty(0),
    )


def surface_contacts(
    distance: FloatArray,
    point: FloatArray,
    normal: FloatArray,
    near: NDArray[np.bool_],
    friction: float,
    span: ContactSpan,
) -> Contacts:
    """Return contacts of one surface.

    Args:
        distance: Signed, negative inside [m], shape (V,).
        point, normal: At begin and end, shape (V, 2, 3).
        near: Which vertices have a plane, shape (V,).
        friction: Coefficient.
        span: For which they hold.
    """
    offset = np.empty((len(distance), 2))
    offset[:] = span.skin[:, None]
    if span.recovery < np.inf:
        np.minimum(span.skin, distance, out=offset[:, 0])
        np.minimum(span.skin, offset[:, 0] + span.recovery * (span.end - span.start), out=offset[:, 1])
    return Contacts(near[None], point[None], normal[None], offset[None], np.array([friction]))
