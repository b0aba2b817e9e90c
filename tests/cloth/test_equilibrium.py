"""Rest by Newton: closed forms, the reported residual, minima instead of saddles, the exact stiffness."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.rest.equilibrium import EquilibriumConfig, equilibrium
from vto_pipeline.errors import DivergedError
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.linear.block_matrix import to_scipy
from vto_pipeline.numerics.linear.direct import DirectSolver
from vto_pipeline.units import GRAVITY


def chain(count, length=1.0, mass=0.3, stiffness=50.0):
    """A plumb chain of equal springs with half masses at its ends, its top held."""
    y = np.linspace(0.0, -length, count + 1)
    points = np.column_stack([0 * y, y, 0 * y])
    masses = np.full(count + 1, mass / count)
    masses[[0, -1]] *= 0.5
    pairs = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    return points, model_of((springs(pairs, points, 1.0 / (stiffness * count)),), masses, pinned=[0])


def hung(columns=9, rows=9, model="hinge", **made):
    mesh, materials = sheet(columns, rows, 0.2, 0.2), Materials(bending=model)
    return mesh, build_cloth(
        mesh, RestShape(mesh.vertices), fabric(**made), pinned=(0, columns - 1), materials=materials
    )


@pytest.mark.parametrize("count", [1, 2, 7, 40])
def test_hanging_chain(count):
    points, model = chain(count)
    found = equilibrium(model, points, EquilibriumConfig(tolerance=1e-12))
    longer = 0.3 * GRAVITY / (2.0 * 50.0)  # W / 2k, for any number of links
    assert_allclose(points[-1, 1] - found.positions[-1, 1], longer, rtol=1e-10)  # tolerance times links


def test_hanging_strip():
    mesh = sheet(5, 21, 0.1, 0.4)
    top = np.flatnonzero(mesh.vertices[:, 1] > -1e-9)
    model = build_cloth(
        mesh, RestShape(mesh.vertices), fabric(stretch=20.0, shear=10.0, density=0.2), pinned=tuple(top)
    )
    found = equilibrium(model, mesh.vertices).positions
    bottom = mesh.vertices[:, 1] < -0.4 + 1e-9
    longer = 0.2 * GRAVITY * 0.4**2 / (2.0 * 20.0)
    assert longer > 5e-3
    assert_allclose((mesh.vertices - found)[bottom, 1].mean(), longer, rtol=2e-3)  # masses in rows near the held edge


def test_no_force_is_left_and_the_last_steps_are_quadratic():
    mesh, model = hung(bending=1e-4)
    found = equilibrium(model, mesh.vertices)
    forces = model.mass[:, None] * model.gravity
    add_forces(found.positions, model.constraints, forces)
    left = np.linalg.norm(forces[model.inverse_mass > 0.0])
    weight = GRAVITY * model.mass[model.inverse_mass > 0.0].sum()
    assert left < 1e-8 * weight
    assert_allclose(found.residuals[-1], left / weight, rtol=1e-6)
    assert found.iterations < 150
    assert 1 <= found.exact < 12
    before, after = found.residuals[-2:]
    assert after < 1e-2 * before


def test_twice_the_same_bits():
    mesh, model = hung(bending=1e-4)
    one, two = equilibrium(model, mesh.vertices), equilibrium(model, mesh.vertices)
    assert (one.positions == two.positions).all()
    assert one.residuals == two.residuals


def test_a_pushed_strip_leaves_the_saddle():
    """Two springs in line, pressed together: straight is a balance of forces, but no minimum."""
    points = np.array([[0.0, 0, 0], [0.5, 1e-6, 0], [1.0, 0, 0]])
    long = springs([[0, 1], [1, 2]], points, 1e-3, rest=0.6)
    model = model_of((long,), np.full(3, 1e-3), pinned=[0, 2], gravity=(0.0, 0.0, 0.0))
    found = equilibrium(model, points, EquilibriumConfig(exact_below=1.0))
    assert_allclose(np.linalg.norm(np.diff(found.positions, axis=0), axis=1), 0.6, rtol=1e-6)
    assert_allclose(np.hypot(*found.positions[1, 1:]), np.sqrt(0.6**2 - 0.5**2), rtol=1e-6)


@pytest.mark.parametrize("bending", ["hinge", "shape_operator"])
def test_exact_stiffness_against_differences_of_forces(bending):
    mesh, model = hung(5, 4, bending, bending=1e-3)
    x = mesh.vertices + np.random.default_rng(0).normal(0.0, 0.01, mesh.vertices.shape)
    stiffness, free = Stiffness(model), np.flatnonzero(model.inverse_mass > 0.0)
    exact = stiffness.assemble_exact(x)
    rows = (3 * free[:, None] + np.arange(3)).ravel()
    found = to_scipy(exact).toarray()[np.ix_(rows, rows)]
    assert_allclose(found, found.T, rtol=0, atol=1e-6 * np.abs(found).max())  # differences of forces
    direction = np.zeros_like(x)
    direction[free] = np.random.default_rng(1).normal(size=(len(free), 3))

    def forces(at):
        total = np.zeros_like(x)
        add_forces(at, model.constraints, total)
        return total[free].ravel()

    slope = (forces(x - 1e-6 * direction) - forces(x + 1e-6 * direction)) / 2e-6
    product = found @ direction[free].ravel()
    assert_allclose(product, slope, rtol=0, atol=1e-5 * np.abs(slope).max())  # differences of two step sizes
    values = np.linalg.eigvalsh(0.5 * (found + found.T))
    assert values.min() < -1e-6 * values.max()  # a crumpled sheet is no equilibrium,
    assert not DirectSolver(exact).factorise(exact.blocks)  # which is what Cholesky's factorisation tells


def test_what_cannot_rest_is_told():
    mesh, model = hung()
    with pytest.raises(DivergedError, match="after 2 Newton steps"):
        equilibrium(model, mesh.vertices, EquilibriumConfig(iterations=2))
