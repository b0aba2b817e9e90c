"""Curvature of triangles: exact for quadratic surfaces on any mesh, with forces that are the slope of the energy."""

import numpy as np
import pytest
from cloth_scenes import fabric, tube
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.constraints.bending.shape_operator import shape_operator
from vto_pipeline.cloth.constraints.sweep import add_forces, linearised
from vto_pipeline.cloth.swatch.meshes import strip
from vto_pipeline.errors import InputError
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh

ORTHOTROPIC = Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 1e-3, 5e-4, 0, 0.3)


def flat(edge=0.05, seed=0):
    points, faces = strip("irregular", 0.0, 0.4, 0.3, edge, seed)
    return TriangleMesh(np.column_stack([points, np.zeros(len(points))]), faces)


def inner(data):
    """Stencils that lie wholly inside the sheet."""
    return (data.vertices[:, 3:] != data.vertices[:, :1]).all(axis=1)


@pytest.mark.parametrize(
    ("warp", "weft", "twist"), [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.7, -1.1, 0.4)]
)
def test_curvature_of_a_quadratic_surface_is_exact(warp, weft, twist):
    mesh = flat()
    data = shape_operator(mesh, RestShape(mesh.vertices), ORTHOTROPIC)
    x, y, _ = mesh.vertices.T
    small = 1e-6
    bent = mesh.vertices.copy()
    bent[:, 2] = -small * (0.5 * warp * y**2 + 0.5 * weft * x**2 + twist * x * y)  # warp runs along y
    found = linearised(bent, data)[0][inner(data)] / small
    assert inner(data).sum() > 20
    wanted = np.tile([warp, weft, -2.0 * twist], (len(found), 1))  # the weft runs against x here
    assert_allclose(found, wanted, rtol=0, atol=3e-3)  # the damping of the fit


def test_a_uniform_moment_pulls_on_no_inner_vertex():
    mesh = flat()
    data = shape_operator(mesh, RestShape(mesh.vertices), fabric(bending=1e-3))
    x, y, _ = mesh.vertices.T
    bent = mesh.vertices.copy()
    bent[:, 2] = 1e-6 * (0.5 * x**2 - 0.2 * y**2 + 0.3 * x * y)
    forces = np.zeros_like(bent)
    add_forces(bent, (data,), forces)
    away = (np.minimum(x, 0.4 - x) > 0.11) & (np.minimum(y, 0.3 - y) > 0.11)
    assert away.sum() > 5
    assert np.abs(forces[away]).max() < 0.01 * np.abs(forces).max()  # what is left is the damping of the fit


@pytest.mark.parametrize(("around", "along"), [(40, 30), (80, 60)])
def test_energy_of_a_cylinder(around, along):
    radius, height = 0.3, 1.2
    mesh = tube(radius, height, around, along)
    data = shape_operator(mesh, RestShape(mesh.vertices), fabric(bending=2e-3))
    whole = 0.5 * 2e-3 / radius**2 * 2 * np.pi * radius * height
    energy = add_forces(mesh.vertices, (data,), np.zeros_like(mesh.vertices))
    assert_allclose(energy / whole, 1.0, rtol=0, atol=10.0 / around**2)  # chord against arc


def test_force_is_minus_the_slope_of_the_energy():
    mesh = flat(0.1)
    data = shape_operator(mesh, RestShape(mesh.vertices), ORTHOTROPIC, poisson=0.2)
    x = mesh.vertices + np.random.default_rng(0).normal(0, 0.02, mesh.vertices.shape)

    def energy(at):
        return add_forces(at, (data,), np.zeros_like(at))

    found = np.zeros_like(x)
    add_forces(x, (data,), found)
    slope = np.empty_like(x)
    for index in np.ndindex(x.shape):
        step = np.zeros_like(x)
        step[index] = 1e-6
        slope[index] = (energy(x + step) - energy(x - step)) / 2e-6
    assert np.linalg.norm(found) > 1e-2
    assert_allclose(found, -slope, rtol=0, atol=1e-6 * np.abs(slope).max())  # central difference


def test_rigid_motion_costs_nothing_and_rest_curvature_is_kept():
    mesh = tube(0.2, 0.4, 20, 12)
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    kept = shape_operator(mesh, RestShape(mesh.vertices, rest_angles=True), fabric(bending=1e-3))
    plain = shape_operator(mesh, RestShape(mesh.vertices), fabric(bending=1e-3))
    moved = mesh.vertices @ turn.T + 0.5
    nothing = np.zeros_like(moved)
    assert_allclose(add_forces(moved, (kept,), nothing.copy()), 0.0, rtol=0, atol=1e-20)  # rounding
    assert add_forces(moved, (plain,), nothing.copy()) > 1e-3


def test_held_triangles_do_not_bend():
    mesh = flat()
    held = np.flatnonzero(mesh.vertices[:, 0] < 0.2)
    some = shape_operator(mesh, RestShape(mesh.vertices), fabric(bending=1e-3), held=held)
    assert len(some.vertices) == (~np.isin(mesh.faces, held).all(axis=1)).sum()


def test_an_impossible_material_is_refused():
    mesh = flat(0.1)
    with pytest.raises(InputError, match="Poisson's ratio of bending is 1.0"):
        shape_operator(mesh, RestShape(mesh.vertices), fabric(bending=1e-3), poisson=1.0)
