"""Membrane and bending against closed forms and finite differences."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet, tube
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.constraints.bend import add_bend_forces, bend
from vto_pipeline.cloth.constraints.stretch import add_stretch_forces, project_stretch, stretch
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.topology import hinges
from vto_pipeline.model.fabric import Fabric
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.bending import dihedral
from vto_pipeline.numerics.membrane import deformation, strains


def energy_of(kind, mesh, cloth, rest_angles=False):
    if kind == "stretch":
        data = stretch(mesh.faces, mesh.vertices, cloth)
        return lambda x: add_stretch_forces(x, data, np.zeros_like(x)), lambda x: forces(add_stretch_forces, x, data)
    data = bend(hinges(mesh), mesh.vertices, rest_angles, cloth)
    return lambda x: add_bend_forces(x, data, np.zeros_like(x)), lambda x: forces(add_bend_forces, x, data)


def forces(add, x, data):
    total = np.zeros_like(x)
    add(x, data, total)
    return total


def crumpled(mesh, amount, seed=0):
    return mesh.vertices + np.random.default_rng(seed).normal(0, amount, mesh.vertices.shape)


@pytest.mark.parametrize("kind", ["stretch", "bend"])
def test_force_is_minus_the_slope_of_the_energy(kind):
    mesh = sheet(4, 5, 0.3, 0.4)
    energy, force = energy_of(kind, mesh, Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 1e-3, 5e-4, 0, 0.3))
    x = crumpled(mesh, 0.03)
    step = 1e-6
    slope = np.empty_like(x)
    for index in np.ndindex(x.shape):
        plus, minus = x.copy(), x.copy()
        plus[index] += step
        minus[index] -= step
        slope[index] = (energy(plus) - energy(minus)) / (2 * step)
    found = force(x)
    assert np.abs(found).min(axis=0).max() > 0.0
    assert np.linalg.norm(found) > 1e-2  # there is something to compare
    assert_allclose(found, -slope, rtol=0, atol=1e-6 * np.abs(slope).max())  # central difference: step² and rounding


@pytest.mark.parametrize("kind", ["stretch", "bend"])
def test_rigid_motion_costs_nothing_and_changes_nothing(kind):
    mesh = sheet(5, 6, 0.3, 0.4)
    energy, force = energy_of(kind, mesh, fabric(poisson=0.2, bending=1e-3))
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    x = crumpled(mesh, 0.03)
    assert_allclose(energy(mesh.vertices @ turn.T + 5.0), 0.0, rtol=0, atol=1e-20)  # rounding at 5 m
    assert energy(x) > 1e-4
    assert_allclose(energy(x @ turn.T + 1.0), energy(x), rtol=1e-10)  # rounding at 1 m
    pull = force(x)
    assert_allclose(pull.sum(axis=0), 0.0, rtol=0, atol=1e-12 * np.abs(pull).sum())  # no net force
    assert_allclose(np.cross(x, pull).sum(axis=0), 0.0, rtol=0, atol=1e-12 * np.abs(pull).sum())  # no net moment


def test_energy_of_known_strains():
    mesh = sheet(4, 5, 0.3, 0.4)
    cloth = Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 0, 0, 0, 0.3)
    energy, _ = energy_of("stretch", mesh, cloth)
    area = 0.12
    minor = 0.3 * 500 / 900
    for warp, weft in ((0.02, 0.0), (0.0, 0.02), (0.02, -0.01)):
        stiffness = np.array([[900, 0.3 * 500], [0.3 * 500, 500]]) / (1 - 0.3 * minor)
        strain = np.array([warp, weft])
        x = mesh.vertices * [1 + weft, 1 + warp, 1]  # warp runs down the sheet
        assert_allclose(energy(x), 0.5 * area * strain @ stiffness @ strain, rtol=1e-12)  # orthotropic plane stress
    angle = 0.1
    x = mesh.vertices @ np.array([[np.cos(angle), np.sin(angle), 0], [0, 1, 0], [0, 0, 1]])
    assert_allclose(energy(x), 0.5 * area * 100 * angle**2, rtol=1e-12)  # threads at 90° less 0.1 rad


def test_bending_energy_of_a_cylinder_on_an_aligned_grid():
    mesh = sheet(33, 9, 1.0, 0.25)
    energy, _ = energy_of("bend", mesh, fabric(bending=2e-3))
    radius = 0.8
    x, y, _ = mesh.vertices.T
    rolled = np.column_stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)])
    inner = 31 / 32  # the hinges of the two end rows do not turn
    assert_allclose(energy(rolled), 0.5 * 2e-3 / radius**2 * 0.25 * inner, rtol=2e-3)  # chord against arc


def test_bending_energy_of_a_cylinder_on_an_isotropic_mesh():
    radius, height = 0.3, 1.2
    mesh = tube(radius, height, 90, 67)  # nearly equilateral
    energy, _ = energy_of("bend", mesh, fabric(bending=2e-3))
    whole = 0.5 * 2e-3 / radius**2 * 2 * np.pi * radius * height
    assert 0.8 < energy(mesh.vertices) / whole < 1.2


def test_rest_angles_keep_a_crease():
    mesh = tube(0.2, 0.4, 20, 12)
    flat, _ = energy_of("bend", mesh, fabric(bending=1e-3))
    kept, _ = energy_of("bend", mesh, fabric(bending=1e-3), rest_angles=True)
    assert flat(mesh.vertices) > 1e-3
    assert_allclose(kept(mesh.vertices), 0.0, rtol=0, atol=1e-25)  # exactly at rest


def test_dihedral_angle_has_the_sign_of_the_fold():
    a, b, c = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 1.0, 0.0)
    for angle in (-2.5, -0.4, 0.0, 1.0, 3.0):
        d = (0.6, -np.cos(angle), -np.sin(angle))  # the second wing turned below the first one's outer side
        assert_allclose(dihedral(a, b, c, d)[0], angle, rtol=0, atol=1e-14)


def test_slivers_are_left_out():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0.0]])
    mesh = TriangleMesh(points, [[0, 1, 2], [0, 3, 1]])
    assert len(stretch(mesh.faces, points, fabric()).vertices) == 1


def test_an_impossible_fabric_is_refused():
    mesh = sheet(3, 3, 1, 1)
    with pytest.raises(InputError, match="not a stable material"):
        stretch(mesh.faces, mesh.vertices, fabric(stretch=100, weft=2000, poisson=0.5))


def test_one_projection_is_one_linear_step():
    """Against the textbook's dense formula, with the gradients by finite difference, far from rest."""
    mesh = TriangleMesh(np.array([[0, 0, 0], [0.1, 0.02, 0], [0.03, 0.12, 0]]), np.array([[0, 1, 2]], np.int32))
    cloth = Fabric("f", 0.2, 3e-4, 900, 500, 100, 0.3, 0, 0, 0, 0.3)
    data = stretch(mesh.faces, mesh.vertices, cloth)
    x = mesh.vertices + np.random.default_rng(3).normal(0, 0.04, (3, 3))
    weights, h_sq = np.array([30.0, 0.0, 70.0]), 1e-4
    before = np.array([1e-5, -2e-5, 3e-6])

    def strain(flat):
        (warp, weft, shear), *_ = strains(*deformation(*map(tuple, flat.reshape(3, 3)), data.gradients[0]))
        return np.array([warp, weft, shear])

    jacobian = np.column_stack([(strain(x.ravel() + s) - strain(x.ravel() - s)) / 2e-6 for s in 1e-6 * np.eye(9)])
    compliance = np.array([[1 / 900, -0.3 / 900, 0], [-0.3 / 900, 1 / 500, 0], [0, 0, 1 / 100]])
    compliance /= data.area[0] * h_sq
    inverse_mass = np.repeat(weights, 3)
    system = jacobian * inverse_mass @ jacobian.T + compliance
    shift = np.linalg.solve(system, -strain(x.ravel()) - compliance @ before)
    moved, multipliers = x.copy(), before[None].copy()
    project_stretch(moved, weights, data, multipliers, h_sq, False)
    assert np.abs(strain(x.ravel())).min() > 0.05
    assert_allclose(multipliers[0] - before, shift, rtol=1e-6)  # the finite difference
    assert_allclose(
        (moved - x).ravel(), inverse_mass * (jacobian.T @ shift), rtol=0, atol=1e-6 * np.abs(moved - x).max()
    )
