"""Formulas of cloth against closed forms: angles, strains of threads, Hooke's law, tension, sliders."""

from math import cos, pi, sin

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from vto_pipeline.numerics.mechanics import membrane, slider
from vto_pipeline.numerics.mechanics.bending import add_dihedral_hessian, dihedral
from vto_pipeline.numerics.mechanics.plane_stress import inverse_compliance, plane_stress, scaled
from vto_pipeline.numerics.mechanics.tension import tensile, tension_pulls, thread_tension

SOFT = (2e-3, 5e-3, 1e-2, -4e-4)  # warp, weft, shear, warp-weft


def matrix(four):
    return np.array([[four[0], four[3], 0.0], [four[3], four[1], 0.0], [0.0, 0.0, four[2]]])


def fold(angle):
    """A hinge along x whose faces, seen from +z counter-clockwise, turn away from each other by an angle."""
    wing = (0.4, -cos(angle), -sin(angle))  # the second face goes down: outer sides apart
    return (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, 1.0, 0.0), wing


@pytest.mark.parametrize("angle", [-3.0, -1.0, -1e-6, 0.0, 0.5, 1.0, 3.0])
def test_a_fold_that_brings_the_outer_sides_apart_is_positive(angle):
    x = fold(angle)
    normals = [np.cross(np.subtract(x[1], x[0]), np.subtract(x[2], x[0])), np.cross(np.subtract(x[3], x[0]), [1, 0, 0])]
    assert normals[0][2] > 0.0  # outer is +z
    apart = np.subtract(x[3], x[0]) @ normals[0]
    assert np.sign(apart) == -np.sign(angle)  # the second face lies below the first where the angle is positive
    assert_allclose(dihedral(*x)[0], angle, rtol=0, atol=1e-14)


def test_its_gradient_is_the_slope():
    x = np.array(fold(0.7)) + np.random.default_rng(0).normal(0.0, 0.1, (4, 3))
    gradient = np.array(dihedral(*map(tuple, x))[1:])
    for index in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[index] = 1e-6
        slope = (dihedral(*map(tuple, x + step))[0] - dihedral(*map(tuple, x - step))[0]) / 2e-6
        assert_allclose(gradient[index], slope, rtol=0, atol=1e-8)
    assert_allclose(gradient.sum(axis=0), 0.0, rtol=0, atol=1e-14)  # moved as one, it stays


@pytest.mark.parametrize("angle", [-2.5, -0.7, 0.0, 0.7, 2.5])
def test_its_second_derivatives_are_the_slopes_of_the_gradient(angle):
    x = np.array(fold(angle)) + np.random.default_rng(1).normal(0.0, 0.1, (4, 3))
    found = np.zeros((4, 4, 3, 3))
    add_dihedral_hessian(2.0, *map(tuple, x), found)
    for a, k in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[a, k] = 1e-6
        ahead, behind = (np.array(dihedral(*map(tuple, y))[1:]) for y in (x + step, x - step))
        assert_allclose(found[:, a, :, k], 2.0 * (ahead - behind) / 2e-6, rtol=0, atol=1e-7 * np.abs(found).max())
    assert_allclose(found, found.transpose(1, 0, 3, 2), rtol=0, atol=1e-13 * np.abs(found).max())


def test_a_wing_without_area_rests():
    x = list(fold(0.5))
    x[2] = (0.5, 0.0, 0.0)
    assert dihedral(*x) == (0.0, *[(0.0, 0.0, 0.0)] * 4)
    blocks = np.zeros((4, 4, 3, 3))
    add_dihedral_hessian(1.0, *x, blocks)
    assert not blocks.any()


@pytest.mark.parametrize("angle", [-0.6, 0.0, 0.6])
def test_strains_of_threads(angle):
    turn = Rotation.from_rotvec([0.4, -1.0, 0.2]).as_matrix()
    fu = turn @ [1.2, 0.0, 0.0]
    fv = turn @ [0.9 * sin(angle), 0.9 * cos(angle), 0.0]
    strain, slopes, _ = membrane.thread_strains(tuple(fu), tuple(fv))
    assert_allclose(strain, (0.2, -0.1, angle), rtol=0, atol=1e-15)
    du, dv = np.array([0.3, -0.2, 0.5]), np.array([-0.1, 0.4, 0.2])
    step = 1e-6
    ahead = membrane.thread_strains(tuple(fu + step * du), tuple(fv + step * dv))[0]
    behind = membrane.thread_strains(tuple(fu - step * du), tuple(fv - step * dv))[0]
    slope = np.subtract(ahead, behind) / (2.0 * step)
    assert_allclose(membrane.strain_changes(slopes, tuple(du), tuple(dv)), slope, rtol=0, atol=1e-9)


@pytest.mark.parametrize("threads", [((0, 0, 0), (1, 0, 0)), ((0, 1, 0), (0, 0, 0)), ((0, 0, 0), (0, 0, 0))])
def test_a_thread_without_length_opens_at_right_angles(threads):
    strain, (u, v, _, _), _ = membrane.thread_strains(*(tuple(map(float, one)) for one in threads))
    assert_allclose(strain, [np.linalg.norm(threads[0]) - 1, np.linalg.norm(threads[1]) - 1, 0.0], rtol=0, atol=0)
    assert_allclose([np.linalg.norm(u), np.linalg.norm(v), np.dot(u, v)], [1.0, 1.0, 0.0], rtol=0, atol=1e-15)


def test_green_strain_is_half_of_right_cauchy_green_less_one():
    f = np.random.default_rng(1).normal(size=(3, 2))
    strain, slopes = membrane.green_strains(tuple(f[:, 0]), tuple(f[:, 1]))
    green = 0.5 * (f.T @ f - np.eye(2))
    assert_allclose(strain, (green[0, 0], green[1, 1], 2.0 * green[0, 1]), rtol=1e-14)
    change = 0.5 * (f.T @ np.ones((3, 2)) + np.ones((2, 3)) @ f)
    ones = (1.0, 1.0, 1.0)
    expected = (change[0, 0], change[1, 1], 2.0 * change[0, 1])
    assert_allclose(membrane.strain_changes(slopes, ones, ones), expected, rtol=1e-14)


def test_deformation_of_a_triangle_maps_rest_edges_to_edges():
    rng = np.random.default_rng(2)
    flat, x = np.array([[0.0, 0.0], [2.0, 0.3], [0.4, 1.5]]), rng.normal(size=(3, 3))
    gradients = np.linalg.inv(np.column_stack([np.ones(3), flat]))[1:]  # of the three shape functions
    fu, fv = membrane.deformation(*map(tuple, x), tuple(gradients.T.ravel()))
    f = np.column_stack([fu, fv])
    for i, j in ((0, 1), (1, 2), (2, 0)):
        assert_allclose(f @ (flat[j] - flat[i]), x[j] - x[i], rtol=0, atol=1e-14)
    force = membrane.corner_force(gradients[0, 1], gradients[1, 1], (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert_allclose(force, gradients[0, 1] * np.array([1, 2, 3]) + gradients[1, 1] * np.array([4, 5, 6]), rtol=1e-14)


def test_mobility_is_its_definition():
    rng = np.random.default_rng(3)
    slopes, weights, g = rng.normal(size=(4, 3)), rng.uniform(0.5, 2.0, 3), rng.normal(size=(3, 2))
    rows = np.zeros((3, 3, 3))  # strain, corner, axis
    for corner, (du, dv) in enumerate(g):
        rows[0, corner], rows[1, corner] = du * slopes[0], dv * slopes[1]
        rows[2, corner] = du * slopes[2] + dv * slopes[3]
    expected = np.einsum("aci,c,bci->ab", rows, weights, rows)
    found = membrane.mobility(tuple(map(tuple, slopes)), *weights, tuple(g.ravel()))
    assert_allclose(found, expected[np.triu_indices(3)], rtol=0, atol=1e-13)


def test_pulls_and_changes_are_transposes():
    rng = np.random.default_rng(4)
    slopes = tuple(map(tuple, rng.normal(size=(4, 3))))
    along, du, dv = rng.normal(size=(3, 3))
    pull_u, pull_v = membrane.pulls(tuple(along), slopes)
    work = np.dot(along, membrane.strain_changes(slopes, tuple(du), tuple(dv)))
    assert_allclose(np.dot(pull_u, du) + np.dot(pull_v, dv), work, rtol=1e-12)


def test_hookes_law():
    strain = (0.01, -0.02, 0.3)
    assert_allclose(matrix(SOFT) @ plane_stress(strain, SOFT), strain, rtol=1e-13)
    assert_allclose(matrix(inverse_compliance(SOFT, 3.0)), 3.0 * np.linalg.inv(matrix(SOFT)), rtol=0, atol=1e-10)
    assert_allclose(scaled(SOFT, 2.0), 2.0 * np.array(SOFT), rtol=0, atol=0)
    isotropic = (1 / 100.0, 1 / 100.0, 2.6 / 100.0, -0.3 / 100.0)  # E h = 100 N/m, ν = 0.3
    assert_allclose(plane_stress((1.0, 0.0, 0.0), isotropic), [100 / 0.91, 30 / 0.91, 0.0], rtol=1e-13)


@pytest.mark.parametrize("stress", [(3, 1, 0), (3, -1, 0), (-3, -1, 0.5), (1, 1, 2), (0, 0, 0), (2, 2, 0)])
def test_tensile_part_of_stress(stress):
    uu, vv, uv = map(float, stress)
    values, vectors = np.linalg.eigh([[uu, uv], [uv, vv]])
    expected = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
    assert_allclose(tensile(uu, vv, uv), (expected[0, 0], expected[1, 1], expected[0, 1]), rtol=0, atol=1e-14)


def test_tension_is_that_of_strings():
    """Two threads at right angles, 1.5 and 1.2 times their rest length, with tensions 3 and 2."""
    fu, fv = (1.5, 0.0, 0.0), (0.0, 1.2, 0.0)
    _, slopes, frame = membrane.thread_strains(fu, fv)
    tension = thread_tension((3.0, 2.0, 0.0), slopes, frame)
    across_u, across_v = np.diag([0.0, 3 / 1.5, 3 / 1.5]), np.diag([2 / 1.2, 0.0, 2 / 1.2])  # tension over length
    for axis in range(3):
        assert_allclose(tension_pulls(tension, 1.0, 0.0, axis)[0], across_u[axis], rtol=0, atol=1e-14)
        assert_allclose(tension_pulls(tension, 0.0, 1.0, axis)[1], across_v[axis], rtol=0, atol=1e-14)
    slack = thread_tension((-3.0, -2.0, 0.0), slopes, frame)
    for axis in range(3):
        assert_allclose(tension_pulls(slack, 1.0, 1.0, axis), 0.0, rtol=0, atol=0)  # what pushes is left out


@pytest.mark.parametrize("extension", [-0.5, -0.02, 0.0, 0.01, 0.3])
def test_a_slider_gives_way_at_its_limit(extension):
    compliance, limit = 0.05, 2.0
    energy, force = slider.huber(extension, compliance, limit)
    assert_allclose(force, np.clip(extension / compliance, -limit, limit), rtol=1e-14)
    work = quad(lambda e: np.clip(e / compliance, -limit, limit), 0.0, extension, points=[-0.1, 0.1])[0]
    assert_allclose(energy, work, rtol=0, atol=1e-12)
    assert_allclose(extension / slider.secant_compliance(extension, compliance, limit), force, rtol=1e-14)
    left = extension - slider.slider_slip(extension, compliance, limit)
    assert_allclose(left / compliance, force, rtol=1e-12)  # return mapping: the force is that of the limit, or less
    assert slider.slider_slip(0.05, compliance, limit) == 0.0


@pytest.mark.parametrize("turns", [-3, -1, 0, 2])
@pytest.mark.parametrize("angle", [-3.1, -0.4, 0.0, 1.0, 3.1])
def test_angles_are_wrapped(turns, angle):
    assert_allclose(slider.wrap_angle(angle + 2.0 * pi * turns), angle, rtol=0, atol=1e-14)
