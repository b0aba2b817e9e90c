"""The scenes of the cloth benches and what is measured on their last frame.

`hang` and `sphere` are a square metre of light cloth, 0.15 kg/m², N x N vertices with alternating diagonals, that
starts flat with a smooth bump of 1 mm and moves for two seconds without damping: hung by two corners, or dropped from
50 mm on a ball of radius 0.3 m. `shirt` is the sample shirt on its dress form, let go until it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from vto_pipeline.bench.measures import edge_strain
from vto_pipeline.bench.samples.garments.shirt import make_hanging_shirt
from vto_pipeline.bench.samples.solids.form import make_form
from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import Collider
from vto_pipeline.cloth.collision.shapes.colliders import Sphere
from vto_pipeline.cloth.judge.crossings import self_crossings
from vto_pipeline.cloth.model.build import ClothModel, ClothState, build_cloth
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.geometry.remeshing.remesh import RemeshConfig, remesh
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SIDE = 1.0  # [m]
AREAL_DENSITY = 0.15  # [kg/m²]
BUMP = 1e-3  # [m]
SECONDS = 2.0
STIFFNESS = 1e4  # E times thickness [N/m]
POISSON = 0.3
RADIUS, DROP, FRICTION = 0.3, 0.05, 0.3
SHIRT_SECONDS, SHIRT_DAMPING = 1.0, 5.0  # [s], [1/s]; the damping is what a drape uses
POPLIN = Fabric("poplin", 0.12, 3e-4, 1500.0, 1200.0, 60.0, 0.2, 1.1e-5, 0.9e-5, 0.0, FRICTION)


@dataclass(frozen=True)
class Scene:
    """A cloth about to move.

    Args:
        name: Such as "hang 32".
        model: The cloth.
        start: Where it begins [m], shape (V, 3).
        rest: Its shape without forces [m], shape (V, 3).
        colliders: What it may touch.
        skin: Distance kept from them [m].
        seconds: How long it moves [s].
        damping: Rate at which velocities fade [1/s].
        ball: Centre of the ball, if there is one [m].
    """

    name: str
    model: ClothModel
    start: FloatArray
    rest: FloatArray
    colliders: Sequence[Collider]
    skin: float
    seconds: float = SECONDS
    damping: float = 0.0
    ball: tuple[float, float, float] | None = None


def isotropic_sheet(stiffness: float, density: float = AREAL_DENSITY, bending: float = 0.0) -> Fabric:
    """Return a sheet with the same stiffness [N/m] in all directions."""
    shear = stiffness / (2.0 * (1.0 + POISSON))
    return Fabric("isotropic", density, 1e-3, stiffness, stiffness, shear, POISSON, bending, bending, 0.0, FRICTION)


def grid(count: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return across and along [m], shape (N²,) each, row by row, and the triangles, shape (2 (N-1)², 3).

    The diagonals alternate, so that no direction is preferred.
    """
    steps = np.linspace(0.0, SIDE, count)
    along, across = (axis.ravel() for axis in np.meshgrid(steps, steps, indexing="ij"))
    row, column = (axis.ravel() for axis in np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij"))
    a = row * count + column
    b, c, d = a + 1, a + count, a + count + 1
    odd = ((row + column) % 2 == 1)[:, None]
    first = np.where(odd, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(odd, np.column_stack([b, d, c]), np.column_stack([a, d, c]))
    return across, along, np.stack([first, second], axis=1).reshape(-1, 3).astype(np.int32)


def hang(count: int, stiffness: float = STIFFNESS) -> Scene:
    """Return the square hung by its two upper corners, N x N vertices; stiffness [N/m]."""
    across, along, faces = grid(count)
    flat = np.column_stack([across - 0.5 * SIDE, along, np.zeros(len(along))])
    start = flat + np.outer(_bump(across, along), [0.0, 0.0, 1.0])
    corners = ((count - 1) * count, count * count - 1)
    model = build_cloth(TriangleMesh(start, faces), RestShape(flat), isotropic_sheet(stiffness), pinned=corners)
    return Scene(f"hang {count}", model, start, flat, (), default_skin(model.edge_length))


def sphere(count: int, stiffness: float = STIFFNESS) -> Scene:
    """Return the square above the ball, N x N vertices; stiffness [N/m]."""
    across, along, faces = grid(count)
    height = RADIUS + DROP
    flat = np.column_stack([across - 0.5 * SIDE, np.full(len(along), height), 0.5 * SIDE - along])
    start = flat + np.outer(_bump(across, along), [0.0, 1.0, 0.0])
    model = build_cloth(TriangleMesh(start, faces), RestShape(flat), isotropic_sheet(stiffness))
    center = (0.0, 0.0, 0.0)
    ball = Sphere(center, RADIUS, FRICTION)
    return Scene(f"sphere {count}", model, start, flat, (ball,), default_skin(model.edge_length), ball=center)


def shirt(edge_mm: float = 20.0, *, seconds: float = SHIRT_SECONDS) -> Scene:
    """Return the sample shirt on its form, as it stands, in poplin; edges of about this length [mm]."""
    mesh, form = shirt_on_form(edge_mm)
    model = build_cloth(mesh, RestShape(mesh.vertices), POPLIN)
    body = BodyCollider(MovingBody(form.vertices[None], form.faces), 0.0, FRICTION)
    skin = default_skin(model.edge_length)
    return Scene(f"shirt {edge_mm:g} mm", model, mesh.vertices, mesh.vertices, (body,), skin, seconds, SHIRT_DAMPING)


def measures(scene: Scene, state: ClothState) -> dict[str, float]:
    """Return what the last frame shows.

    Args:
        scene: What was computed.
        state: Where it ended; finite.

    Returns:
        rms_stretch and max_stretch of |l / l₀ - 1| over the edges, mean_height_m weighted by mass, kinetic_j; with a
        ball how deep the deepest vertex and the deepest point of the surface are in it, and pairs of crossing faces.
    """
    x, mass = state.positions, scene.model.mass
    stretch = np.abs(edge_strain(x, scene.rest, scene.model.faces))
    free = scene.model.inverse_mass > 0.0
    found = {
        "rms_stretch": float(np.sqrt(np.mean(stretch**2))),
        "max_stretch": float(stretch.max()),
        "mean_height_m": float(mass @ x[:, 1] / mass.sum()),
        "kinetic_j": float(0.5 * mass[free] @ (state.velocities[free] ** 2).sum(axis=1)),
    }
    if scene.ball is not None:
        mesh = TriangleMesh(x, scene.model.faces)
        vertex = np.linalg.norm(x - scene.ball, axis=1).min()
        surface = SurfaceDistance(mesh).nearest(np.array([scene.ball])).distance[0]
        found["vertex_penetration_mm"] = float(1e3 * max(RADIUS - vertex, 0.0))
        found["penetration_mm"] = float(1e3 * max(RADIUS - surface, 0.0))
        found["self_crossings"] = len(self_crossings(mesh))
    return found


def _bump(across: FloatArray, along: FloatArray) -> FloatArray:
    bump: FloatArray = BUMP * np.sin(np.pi * across / SIDE) * np.sin(np.pi * along / SIDE)
    return bump


@cache
def shirt_on_form(edge_mm: float) -> tuple[TriangleMesh, TriangleMesh]:
    """Return the sample shirt as it is cut, edges of about this length [mm], and its dress form."""
    form = make_form()
    return remesh(make_hanging_shirt(form), RemeshConfig(edge_mm=edge_mm), Job()), form.mesh
