"""Build model (constants) and state (variables) from a mesh, its rest shape and a fabric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints.points.attachment import attachments
from vto_pipeline.cloth.model.materials import Materials, fabric_constraints
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_OWN_SIZE = 0.2  # of a triangle's lowest height: two such reaches are less than the way to its second neighbours
_LEAST_MASS = 1e-3  # of the median: a vertex with slivers only must still be movable


@dataclass(frozen=True)
class ClothModel:
    """A cloth, constant over time.

    Args:
        faces: Shape (F, 3).
        mass: [kg], shape (V,).
        inverse_mass: [1/kg], zero for held vertices, shape (V,).
        constraints: What resists deformation: the data of each kind of `constraints.KINDS` that it has.
        edge_length: Median rest length of the edges [m].
        gravity: [m/s²], shape (3,).
        reach: Half the distance each vertex keeps from the rest of the cloth [m], shape (V,).
        friction: Coulomb coefficient of each vertex, cloth against cloth, shape (V,).
    """

    faces: IntArray
    mass: FloatArray
    inverse_mass: FloatArray
    constraints: tuple[Any, ...]
    edge_length: float
    gravity: FloatArray
    reach: FloatArray
    friction: FloatArray


@dataclass(frozen=True)
class ClothState:
    """The state of a cloth.

    Args:
        positions: [m], shape (V, 3).
        velocities: [m/s], shape (V, 3).
        time: [s].
        sliders: Where internal friction and plasticity stand; see `internal_friction`. None before the first step.
    """

    positions: FloatArray
    velocities: FloatArray
    time: float = 0.0
    sliders: tuple[FloatArray, ...] = ()


def at_rest(positions: FloatArray) -> ClothState:
    """Return the state of a cloth at rest; positions [m], shape (V, 3)."""
    return ClothState(positions.copy(), np.zeros_like(positions))


def build_cloth(
    mesh: TriangleMesh,
    rest: RestShape,
    fabric: Fabric,
    *,
    pinned: NDArray[np.int64] | tuple[int, ...] = (),
    pin_compliance: float | None = None,
    gravity: tuple[float, float, float] = (0.0, -GRAVITY, 0.0),
    materials: Materials | None = None,
    job: Job | None = None,
) -> ClothModel:
    """Return the model of a cloth.

    Args:
        mesh: Its triangles; where they are now matters only to pins that give way.
        rest: Its shape without forces.
        fabric: Its mass and stiffnesses.
        pinned: Vertices held where they are.
        pin_compliance: How far a pin gives way under a force [m/N]; None is rigid.
        gravity: [m/s²].
        materials: How the fabric is modelled.
        job: For what was left out.

    Raises:
        InputError: rest shape and mesh differ in size, a pinned vertex does not exist, no triangle has an area, an
            edge has more than two faces, or the fabric is not a stable material.
    """
    count = len(mesh.vertices)
    if len(rest.positions) != count:
        raise InputError(f"rest shape has {len(rest.positions)} vertices, the mesh {count}")
    held = np.asarray(pinned, dtype=np.int64)
    if held.size and not (held.min() >= 0 and held.max() < count):
        raise InputError(f"pinned vertex {held.min() if held.min() < 0 else held.max()} is outside 0..{count - 1}")
    corners = rest.corners(mesh.faces)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not area.sum() > 0.0:
        raise InputError("no triangle of the rest shape has an area", hint="is the garment collapsed to a line?")
    mass = np.zeros(count)
    np.add.at(mass, mesh.faces, (fabric.areal_density * area / 3.0)[:, None])
    used = np.bincount(mesh.faces.reshape(-1), minlength=count) > 0
    mass = np.where(used, np.maximum(mass, _LEAST_MASS * np.median(mass[used])), 0.0)
    inverse_mass = np.divide(1.0, mass, out=np.zeros(count), where=mass > 0.0)
    constraints = fabric_constraints(mesh, rest, fabric, checked(Materials, materials), job or Job(), held)
    if pin_compliance is None:
        inverse_mass[held] = 0.0
    else:
        constraints += (attachments(held, mesh.vertices[held], mesh.vertices, pin_compliance),)
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return ClothModel(
        faces=mesh.faces,
        mass=mass,
        inverse_mass=inverse_mass,
        constraints=constraints,
        edge_length=float(np.median(edges)),
        gravity=np.array(gravity, dtype=np.float64),
        reach=_reaches(corners, mesh.faces, count, fabric.thickness),
        friction=np.full(count, fabric.friction),
    )


def _reaches(corners: FloatArray, faces: IntArray, count: int, thickness: float) -> FloatArray:
    """Return half the thickness, less where triangles are so small that neighbours would keep each other apart.

    Args:
        corners: Of the triangles at rest [m], shape (F, 3, 3).
        faces: Shape (F, 3).
        count: Of vertices.
        thickness: [m].
    """
    edges = np.roll(corners, -1, axis=1) - corners
    double = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    lowest = np.divide(double, longest, out=np.zeros_like(double), where=longest > 0.0)
    reach = np.full(count, 0.5 * thickness)
    np.minimum.at(reach, faces, (_OWN_SIZE * lowest)[:, None])
    return reach


def model_of(
    constraints: tuple[Any, ...],
    mass: FloatArray,
    *,
    pinned: Sequence[int] = (),
    gravity: tuple[float, float, float] = (0.0, -GRAVITY, 0.0),
    faces: IntArray | None = None,
    edge_length: float = 0.01,
) -> ClothModel:
    """Return a model of given parts: a spring, a strand, a chain.

    Args:
        constraints: The data of each kind.
        mass: [kg], shape (V,).
        pinned: Vertices held where they are.
        gravity: [m/s²].
        faces: Triangles, if there are any, shape (F, 3).
        edge_length: What the default skin is measured by [m].
    """
    inverse_mass = 1.0 / np.asarray(mass, dtype=np.float64)
    inverse_mass[list(pinned)] = 0.0
    return ClothModel(
        np.empty((0, 3), np.int32) if faces is None else faces,
        np.array(mass, dtype=np.float64),
        inverse_mass,
        constraints,
        edge_length,
        np.array(gravity, dtype=np.float64),
        np.zeros(len(mass)),
        np.zeros(len(mass)),
    )


def without_gravity(model: ClothModel) -> ClothModel:
    """Return the same cloth, weightless."""
    return replace(model, gravity=np.zeros(3))
