"""The matrix of an implicit step against differences of the forces, and what every such matrix must be."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.constraints.sweep import add_damping_forces, add_forces
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import PARALLEL_FROM, to_scipy

MATERIALS = {
    "threads": Materials(bending="none"),
    "threads and hinges": Materials(),
    "threads and isometric": Materials(bending="isometric"),
    "green and hinges": Materials(membrane="green"),
    "springs": Materials(membrane="springs", bending="none"),
    "curve": Materials(membrane="curve"),
}


def cloth(side, materials, pinned=(), rayleigh=0.0):
    mesh = sheet(side, side, 0.05 * (side - 1), 0.05 * (side - 1))
    stuff = fabric(stretch=900.0, weft=500.0, shear=100.0, poisson=0.2, bending=1e-3)
    given = materials.model_copy(update={"rayleigh": rayleigh})
    return mesh, build_cloth(mesh, RestShape(mesh.vertices), stuff, pinned=pinned, materials=given)


def taut(mesh):
    """Pulled a little in both directions and turned, so that stress is tensile all over."""
    pulled = mesh.vertices * [1.01, 1.02, 1.0]
    return pulled @ Rotation.from_rotvec([0.3, 0.5, -0.4]).as_matrix()


def forces(model, x):
    found = np.zeros_like(x)
    add_forces(x, model.constraints, found)
    return found


def slope(function, x, step=1e-6):
    columns = []
    for index in np.ndindex(x.shape):
        plus, minus = x.copy(), x.copy()
        plus[index] += step
        minus[index] -= step
        columns.append((function(plus) - function(minus)).ravel() / (2.0 * step))
    return np.array(columns).T


@pytest.mark.parametrize("name", MATERIALS)
def test_of_taut_cloth_it_is_the_slope_of_the_force(name):
    mesh, model = cloth(4, MATERIALS[name])
    x = taut(mesh)
    exact = -slope(lambda y: forces(model, y), x)
    found = to_scipy(Stiffness(model).assemble(x)).toarray()
    assert_allclose(found, exact, rtol=0, atol=2e-6 * np.abs(exact).max())  # central difference; hinges are flat


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize("crumpled", [0.0, 0.002, 0.02, 0.2])
def test_it_is_symmetric_and_gives_no_energy_away(name, crumpled):
    mesh, model = cloth(4, MATERIALS[name])
    x = mesh.vertices + np.random.default_rng(0).normal(0.0, crumpled, mesh.vertices.shape)
    found = to_scipy(Stiffness(model).assemble(x)).toarray()
    assert_allclose(found, found.T, rtol=0, atol=1e-12 * np.abs(found).max())  # rounding
    assert np.linalg.eigvalsh(found).min() > -1e-11 * np.abs(found).max()


def test_mass_stiffness_and_damping_have_their_factors():
    mesh, model = cloth(4, MATERIALS["threads and hinges"], rayleigh=0.02)
    x = taut(mesh)
    stiffness = Stiffness(model)
    elastic = to_scipy(stiffness.assemble(x)).toarray()
    all_three = to_scipy(stiffness.assemble(x, 5.0, 2.0, 7.0)).toarray()

    def drag(v):
        found = np.zeros_like(x)
        add_damping_forces(x, v, model.constraints, found)
        return found

    viscous = -slope(drag, np.zeros_like(x), 1.0)  # linear in v
    expected = 5.0 * np.diag(np.repeat(model.mass, 3)) + 2.0 * elastic + 7.0 * viscous
    assert np.abs(viscous).max() > 1.0
    assert_allclose(all_three, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_held_vertices_are_rows_of_the_identity():
    mesh, model = cloth(4, MATERIALS["threads and hinges"])
    _, held = cloth(4, MATERIALS["threads and hinges"], pinned=(0, 3, 9))
    x = taut(mesh)
    free = to_scipy(Stiffness(model).assemble(x, 5.0)).toarray().reshape(16, 3, 16, 3)
    found = to_scipy(Stiffness(held).assemble(x, 5.0)).toarray().reshape(16, 3, 16, 3)
    fixed = np.isin(np.arange(16), (0, 3, 9))
    assert_array_equal(found[fixed][:, :, fixed].reshape(9, 9), np.eye(9))
    assert not found[fixed][:, :, ~fixed].any()
    assert not found[~fixed][:, :, fixed].any()
    scale = np.abs(free).max()
    assert_allclose(found[~fixed][:, :, ~fixed], free[~fixed][:, :, ~fixed], rtol=0, atol=1e-14 * scale)


def test_a_cloth_of_nothing_but_mass():
    model = model_of((), np.array([0.1, 0.2, 0.3]), pinned=(1,))
    found = to_scipy(Stiffness(model).assemble(np.zeros((3, 3)), 10.0)).toarray()
    assert_array_equal(found, np.diag(np.repeat([1.0, 1.0, 3.0], 3)))


def test_of_a_spring_it_is_the_textbooks():
    x = np.array([[0.0, 0.0, 0.0], [0.0, 1.5, 0.0]])
    model = model_of((springs([[0, 1]], x, 1e-2, rest=1.0),), np.ones(2))
    found = to_scipy(Stiffness(model).assemble(x)).toarray()
    one = np.diag([50.0 / 1.5, 100.0, 50.0 / 1.5])  # tension over length across, 1/α along
    assert_allclose(found, np.block([[one, -one], [-one, one]]), rtol=0, atol=1e-12)


def test_the_last_matrix_is_overwritten():
    mesh, model = cloth(3, MATERIALS["threads"])
    stiffness = Stiffness(model)
    first = stiffness.assemble(mesh.vertices, 1.0)
    kept = first.blocks.copy()
    again = stiffness.assemble(mesh.vertices, 1.0)
    assert again.blocks is first.blocks
    assert_array_equal(again.blocks, kept)  # and nothing is added up


def large(rayleigh=0.0):
    mesh, model = cloth(52, MATERIALS["threads and hinges"], (0, 51), rayleigh)
    assert len(mesh.vertices) >= PARALLEL_FROM
    return model, mesh.vertices + np.random.default_rng(0).normal(0.0, 2e-3, mesh.vertices.shape)


def test_it_has_the_same_bits_with_one_thread_and_two():
    model, x = large()
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            found.append(Stiffness(model).assemble(x, 4.0, 1.0).blocks)
    assert_array_equal(found[0], found[1])


def test_threads_that_share_the_work_find_what_one_loop_finds():
    """Its first rows of vertices alone are a sheet under the size from which threads share the work."""
    model, x = large()
    mesh = sheet(52, 3, 0.05 * 51, 0.1)
    stuff = fabric(stretch=900.0, weft=500.0, shear=100.0, poisson=0.2, bending=1e-3)
    small = build_cloth(mesh, RestShape(mesh.vertices), stuff, pinned=(0, 51))
    first = slice(0, 3 * 52)  # no triangle or hinge of another part of the sheet reaches the first row
    whole = to_scipy(Stiffness(model).assemble(x)).tocsr()[first, first].toarray()
    part = to_scipy(Stiffness(small).assemble(x[: 3 * 52])).tocsr()[first, first].toarray()
    assert_allclose(part, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


def test_forces_have_the_same_bits_with_one_thread_and_two():
    model, x = large(rayleigh=0.01)
    v = np.random.default_rng(1).normal(size=x.shape)
    found = []
    for threads in (1, 2):
        with limited_threads(threads):
            pull, drag = np.zeros_like(x), np.zeros_like(x)
            energy = add_forces(x, model.constraints, pull)
            add_damping_forces(x, v, model.constraints, drag)
            found.append((energy, pull, drag))
    assert found[0][0] == found[1][0] > 0.0
    assert_array_equal(found[0][1], found[1][1])
    assert_array_equal(found[0][2], found[1][2])
    assert np.abs(found[0][2]).max() > 0.0
