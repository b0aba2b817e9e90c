"""Colliders for users: analytic solids and meshes. All are at rest; `moving.Moving` moves them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan
from vto_pipeline.cloth.collision.shapes.pose import Pose, Turn, Vector, along_y, pose
from vto_pipeline.cloth.collision.shapes.solid import solid_contacts
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.solids import ELLIPSOID, HALF_SPACE, ROUNDED_BOX


@dataclass(frozen=True)
class Sphere:
    """A ball: center [m], radius [m], Coulomb friction."""

    center: Vector
    radius: float
    friction: float = 0.3

    def __post_init__(self) -> None:
        _check_sizes("sphere radius", self.radius)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        size = (0.0, 0.0, 0.0, self.radius)
        return solid_contacts(ROUNDED_BOX, size, pose(self.center), self.friction, positions, span)


@dataclass(frozen=True)
class Capsule:
    """A rod with round ends: end points [m], radius [m], Coulomb friction."""

    start: Vector
    end: Vector
    radius: float
    friction: float = 0.3

    def __post_init__(self) -> None:
        _check_sizes("capsule radius", self.radius)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        axis, middle = np.subtract(self.end, self.start), 0.5 * np.add(self.start, self.end)
        length = float(np.linalg.norm(axis))
        where = Pose(along_y(axis) if length > 0.0 else np.eye(3), middle)
        size = (0.0, 0.5 * length, 0.0, self.radius)
        return solid_contacts(ROUNDED_BOX, size, where, self.friction, positions, span)


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid: center [m], semi-axes along its own x, y, z [m], rotation, Coulomb friction."""

    center: Vector
    radii: Vector
    rotation: Turn = (0.0, 0.0, 0.0)
    friction: float = 0.3

    def __post_init__(self) -> None:
        _check_sizes("ellipsoid radius", *self.radii)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        x, y, z = self.radii
        where = pose(self.center, self.rotation)
        return solid_contacts(ELLIPSOID, (x, y, z, 0.0), where, self.friction, positions, span)


@dataclass(frozen=True)
class Box:
    """A box: center [m], half its sizes along its own x, y, z [m], rotation, Coulomb friction."""

    center: Vector
    half_sizes: Vector
    rotation: Turn = (0.0, 0.0, 0.0)
    friction: float = 0.3

    def __post_init__(self) -> None:
        _check_sizes("half size of a box", *self.half_sizes)

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        x, y, z = self.half_sizes
        where = pose(self.center, self.rotation)
        return solid_contacts(ROUNDED_BOX, (x, y, z, 0.0), where, self.friction, positions, span)


@dataclass(frozen=True)
class Plane:
    """A half-space: a point on its face [m], the normal out of it, Coulomb friction."""

    point: Vector
    normal: Vector
    friction: float = 0.3

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.normal) > 0.0:
            raise InputError(f"plane normal is {self.normal}; expected a direction")

    def contacts(self, positions: FloatArray, span: ContactSpan) -> Contacts:
        """See `Collider.contacts`."""
        where = Pose(along_y(self.normal), np.asarray(self.point, dtype=np.float64))
        return solid_contacts(HALF_SPACE, (0.0, 0.0, 0.0, 0.0), where, self.friction, positions, span)


@dataclass(frozen=True)
class MeshCollider:
    """A surface: triangles counter-clockwise seen from outside, Coulomb friction.

    One that changes its shape is a `MovingBody`: keyframes spread evenly over `seconds`, then at rest.
    """

    mesh: TriangleMesh | MovingBody
    friction: float = 0.3
    seconds: float = 0.0


def _check_sizes(name: str, *sizes: float) -> None:
    for size in sizes:
        if not 0.0 < size < np.inf:
            raise InputError(f"{name} is {size}; expected a length above zero")
