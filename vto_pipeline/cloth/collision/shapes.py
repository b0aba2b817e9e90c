"""Colliders with a formula: sphere, capsule, plane. And a mesh at rest, as users give it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts, Round, ride
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Sphere:
    """A fixed ball: center [m], radius [m], Coulomb friction."""

    center: Vector
    radius: float
    friction: float = 0.3

    def contacts(self, positions: FloatArray, span: Round) -> Contacts:
        """See `Collider.contacts`."""
        return _round_contacts(
            positions, np.broadcast_to(self.center, positions.shape), self.radius, self.friction, span
        )


@dataclass(frozen=True)
class Capsule:
    """A fixed rod with round ends: end points [m], radius [m], Coulomb friction."""

    start: Vector
    end: Vector
    radius: float
    friction: float = 0.3

    def contacts(self, positions: FloatArray, span: Round) -> Contacts:
        """See `Collider.contacts`."""
        start, axis = np.array(self.start), np.subtract(self.end, self.start)
        along = np.clip((positions - start) @ axis / max(float(axis @ axis), 1e-300), 0.0, 1.0)
        return _round_contacts(positions, start + along[:, None] * axis, self.radius, self.friction, span)


@dataclass(frozen=True)
class Plane:
    """A fixed half-space: a point on its face [m], the normal out of it, Coulomb friction."""

    point: Vector
    normal: Vector
    friction: float = 0.3

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.normal) > 0.0:
            raise InputError(f"plane normal is {self.normal}; wanted a direction")

    def contacts(self, positions: FloatArray, span: Round) -> Contacts:
        """See `Collider.contacts`."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        distance = (positions - self.point) @ normal
        point = positions - distance[:, None] * normal
        return _still(distance, point, np.broadcast_to(normal, positions.shape), self.friction, span)


@dataclass(frozen=True)
class MeshCollider:
    """A fixed surface: triangles counter-clockwise seen from outside, Coulomb friction."""

    mesh: TriangleMesh
    friction: float = 0.3


def _round_contacts(positions: FloatArray, axis: FloatArray, radius: float, friction: float, span: Round) -> Contacts:
    """Return contacts with a surface `radius` away from the nearest axis points, shape (V, 3)."""
    away = positions - axis
    length = np.linalg.norm(away, axis=1)
    up = np.broadcast_to([0.0, 1.0, 0.0], away.shape)
    normal = np.where(length[:, None] > 0.0, away / np.maximum(length, 1e-300)[:, None], up)
    return _still(length - radius, axis + radius * normal, normal, friction, span)


def _still(distance: FloatArray, point: FloatArray, normal: FloatArray, friction: float, span: Round) -> Contacts:
    """Return contacts with a surface that does not move; point and normal of shape (V, 3)."""
    twice = (len(distance), 2, 3)
    near = distance < span.skin + span.travel
    return ride(
        distance,
        np.ascontiguousarray(np.broadcast_to(point[:, None], twice)),
        np.ascontiguousarray(np.broadcast_to(normal[:, None], twice)),
        friction,
        near,
        span,
    )
