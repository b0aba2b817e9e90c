"""From a mesh, its rest shape and a fabric to what a solver works on: constants (model) and what varies (state)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.cloth.constraints import Constraints
from vto_pipeline.cloth.constraints.bend import bend
from vto_pipeline.cloth.constraints.stretch import stretch
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import hinges
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

_LEAST_MASS = 1e-3  # of the median: a vertex with slivers only must still be movable


@dataclass(frozen=True)
class ClothModel:
    """A cloth, constant over time.

    Args:
        faces: Shape (F, 3).
        mass: [kg], shape (V,).
        inverse_mass: [1/kg], zero for held vertices, shape (V,).
        constraints: What resists deformation.
        edge_length: Median rest length of the edges [m].
        gravity: [m/s²], shape (3,).
    """

    faces: IntArray
    mass: FloatArray
    inverse_mass: FloatArray
    constraints: Constraints
    edge_length: float
    gravity: FloatArray


@dataclass(frozen=True)
class ClothState:
    """What varies: positions [m] and velocities [m/s], shape (V, 3) each, and the time [s]."""

    positions: FloatArray
    velocities: FloatArray
    time: float = 0.0


def at_rest(positions: FloatArray) -> ClothState:
    """Return the state of a cloth that does not move; positions [m], shape (V, 3)."""
    return ClothState(positions.copy(), np.zeros_like(positions))


def build(
    mesh: TriangleMesh,
    rest: RestShape,
    fabric: Fabric,
    *,
    pinned: NDArray[np.int64] | tuple[int, ...] = (),
    gravity: tuple[float, float, float] = (0.0, -GRAVITY, 0.0),
    job: Job | None = None,
) -> ClothModel:
    """Return the model of a cloth.

    Args:
        mesh: Its triangles; where they are now does not matter.
        rest: Its shape without forces.
        fabric: Its mass and stiffnesses.
        pinned: Vertices held where they are.
        gravity: [m/s²].
        job: For what was left out.

    Raises:
        InputError: rest shape and mesh differ in size, a pinned vertex does not exist, no triangle has an area, an
            edge has more than two faces, or the fabric is not a stable material.
    """
    job = job or Job()
    positions = rest.positions
    count = len(mesh.vertices)
    if len(positions) != count:
        raise InputError(f"rest shape has {len(positions)} vertices, the mesh {count}")
    held = np.asarray(pinned, dtype=np.int64)
    if held.size and not (held.min() >= 0 and held.max() < count):
        raise InputError(f"pinned vertex {held.min() if held.min() < 0 else held.max()} is outside 0..{count - 1}")
    corners = positions[mesh.faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not area.sum() > 0.0:
        raise InputError("no triangle of the rest shape has an area", hint="is the garment flattened to a line?")
    mass = np.zeros(count)
    np.add.at(mass, mesh.faces, (fabric.areal_density * area / 3.0)[:, None])
    used = np.bincount(mesh.faces.reshape(-1), minlength=count) > 0
    mass = np.where(used, np.maximum(mass, _LEAST_MASS * np.median(mass[used])), 0.0)
    inverse_mass = np.divide(1.0, mass, out=np.zeros(count), where=mass > 0.0)
    inverse_mass[held] = 0.0
    bends = fabric.bending_warp > 0.0 or fabric.bending_weft > 0.0
    if bends or job.force_all:
        found = hinges(mesh)
    else:
        job.leave_out("hinges", "the fabric does not resist bending")
        found = np.empty((0, 4), np.int32)
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return ClothModel(
        faces=mesh.faces,
        mass=mass,
        inverse_mass=inverse_mass,
        constraints=Constraints(
            stretch(mesh.faces, positions, fabric), bend(found, positions, rest.rest_angles, fabric)
        ),
        edge_length=float(np.median(edges)),
        gravity=np.array(gravity, dtype=np.float64),
    )


def without_gravity(model: ClothModel) -> ClothModel:
    """Return the same cloth, weightless."""
    return replace(model, gravity=np.zeros(3))
