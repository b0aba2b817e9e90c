"""Sheets, tubes and fabrics the cloth tests share."""

import numpy as np
import trimesh

from vto_pipeline.cloth.collision.contacts import ContactSpan, gather_contacts
from vto_pipeline.cloth.collision.shapes.colliders import Plane
from vto_pipeline.cloth.model.build import ClothState, model_of
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh


def fabric(*, stretch=1000.0, weft=None, shear=200.0, poisson=0.0, bending=0.0, density=0.2, friction=0.3):
    """A made-up fabric."""
    return Fabric("test", density, 3e-4, stretch, weft or stretch, shear, poisson, bending, bending, 0.0, friction)


def sheet(columns, rows, width, height, upright=True):
    """A grid in the plane z = 0 (upright, row 0 on top) or y = 0."""
    x, y = np.meshgrid(np.linspace(0, width, columns), np.linspace(0, -height, rows))
    flat = np.zeros(x.size)
    points = np.column_stack([x.ravel(), y.ravel(), flat] if upright else [x.ravel(), flat, -y.ravel()])
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    odd = (np.add.outer(np.arange(rows - 1), np.arange(columns - 1)).ravel() % 2).astype(bool)
    a, b, c, d = corner, corner + 1, corner + columns, corner + columns + 1
    one = np.where(odd[:, None], np.column_stack([a, c, b]), np.column_stack([a, c, d]))
    two = np.where(odd[:, None], np.column_stack([b, c, d]), np.column_stack([a, d, b]))
    return TriangleMesh(points, np.vstack([one, two]).astype(np.int32))


def across_a_ridge(room, poke):
    """Cloth with edges of 30 mm, and a ridge that stands out of it by `poke`, `room` below a wall [m].

    No vertex of the cloth lies on the ridge.
    """
    ridge = trimesh.creation.box([0.1, 0.1, 0.17])
    ridge.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 4, [0.0, 0.0, 1.0]))
    ridge.apply_translation([0.0, -np.sqrt(0.005), 0.0])
    wall = trimesh.creation.box([0.2, 0.05, 0.17])
    wall.apply_translation([0.0, room + 0.025, 0.0])
    both = trimesh.util.concatenate([ridge, wall]).subdivide().subdivide().subdivide()
    cloth = sheet(9, 9, 0.24, 0.24, upright=False)
    cloth = TriangleMesh(cloth.vertices - np.array([0.111, poke, 0.12]), cloth.faces)
    return cloth, TriangleMesh(np.array(both.vertices), np.array(both.faces, np.int32))


def tube(radius, height, around, along, base=0.0):
    """An open cylinder about the y axis, outward normals, with staggered rings."""
    angle = np.add.outer(0.5 * (np.arange(along) % 2), np.arange(around)) * 2 * np.pi / around
    y = np.repeat(base + np.linspace(0, height, along), around)
    points = np.column_stack([radius * np.cos(angle.ravel()), y, radius * np.sin(angle.ravel())])
    faces = []
    for ring in range(along - 1):
        i = np.arange(around)
        a, b = ring * around + i, ring * around + (i + 1) % around
        c, d = a + around, b + around
        if ring % 2 == 0:
            faces += [np.column_stack([a, c, b]), np.column_stack([b, c, d])]
        else:
            faces += [np.column_stack([a, c, d]), np.column_stack([a, d, b])]
    return TriangleMesh(points, np.vstack(faces).astype(np.int32))


def ball(radius, center=(0.0, 0.0, 0.0), levels=3):
    """An icosphere."""
    mesh = trimesh.creation.icosphere(levels, radius)
    return TriangleMesh(mesh.vertices + np.asarray(center), mesh.faces)


def box(size, center=(0.0, 0.0, 0.0)):
    """A box."""
    mesh = trimesh.creation.box(size).subdivide()
    return TriangleMesh(mesh.vertices + np.asarray(center), mesh.faces)


def moved(mesh, x, y, z):
    """The same mesh elsewhere."""
    return TriangleMesh(mesh.vertices + np.array([x, y, z]), mesh.faces)


def bead_on_floor(height, velocity):
    """A bead over a floor with friction, and their contact: model, state and contacts."""
    floor = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.3)
    state = ClothState(np.array([[0.0, height, 0.0]]), np.array([velocity]))
    contacts = gather_contacts([floor], state.positions, ContactSpan(0.0, 0.1, 0.1, np.full(1, 1e-3), 0.5))
    return model_of((), np.full(1, 0.01)), state, contacts
