"""Every kind of constraint, by what any kind must do: forces, linear parts, stiffness, projections, rigid motion."""

import numpy as np
import pytest
from constraint_examples import MESH, MOVED_BY_SPACE, NAMES, WITHOUT_DAMPER, crumpled, examples
from numba import njit
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.collision.contacts import empty_contacts
from vto_pipeline.cloth.constraints import KINDS
from vto_pipeline.cloth.constraints.sweep import (
    add_damping_forces,
    add_forces,
    add_lacking,
    linearised,
    multipliers,
    prepare_all,
    project,
)
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import at_rest, model_of
from vto_pipeline.cloth.solvers.xpbd import Xpbd
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import to_scipy

EXAMPLES = examples()


def energy(x, data):
    return add_forces(x, (data,), np.zeros_like(x))


def forces(x, data):
    total = np.zeros_like(x)
    add_forces(x, (data,), total)
    return total


def slope(x, function, step=1e-6):
    """Central differences of a function of positions, along the last axes."""
    found = []
    for index in np.ndindex(x.shape):
        plus, minus = x.copy(), x.copy()
        plus[index] += step
        minus[index] -= step
        found.append((function(plus) - function(minus)) / (2.0 * step))
    return np.stack(found, axis=-1)


def stiffness_of(x, data):
    return to_scipy(Stiffness(model_of((data,), np.ones(len(x)))).assemble(x)).toarray()


def test_there_is_an_example_of_every_kind():
    assert {type(data) for data in EXAMPLES.values()} == {kind.data for kind in KINDS}


@pytest.mark.parametrize("name", NAMES)
def test_force_is_minus_the_slope_of_the_energy(name):
    data, x = EXAMPLES[name], crumpled()
    found = forces(x, data)
    assert np.linalg.norm(found) > 1e-2  # there is something to compare
    expected = -slope(x, lambda y: energy(y, data)).reshape(x.shape)
    assert_allclose(found, expected, rtol=0, atol=1e-6 * np.abs(found).max())  # central difference: step² and rounding


@pytest.mark.parametrize("name", NAMES)
def test_linear_parts_give_the_same_force(name):
    data, x = EXAMPLES[name], crumpled()
    values, gradients, compliance = linearised(x, data)
    stress = np.linalg.solve(compliance, values[:, :, None])[:, :, 0]
    found = np.zeros_like(x)
    np.add.at(found, data.vertices, -np.einsum("nb,nbsk->nsk", stress, gradients))
    expected = forces(x, data)
    assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())  # rounding
    assert_allclose(compliance, compliance.transpose(0, 2, 1), rtol=0, atol=0)
    assert (np.linalg.eigvalsh(compliance) > 0.0).all()


LAW_OF_ITS_OWN = {"curve", "hinge_moments", "strain_limit"}  # C gives the stress and is not what the gradients are of


@pytest.mark.parametrize("name", sorted(set(NAMES) - LAW_OF_ITS_OWN))
def test_gradients_are_slopes_of_the_values(name):
    data, x = EXAMPLES[name], crumpled()
    values, gradients, _ = linearised(x, data)
    dense = np.zeros((*values.shape, *x.shape))
    for i, vertices in enumerate(data.vertices):
        for corner, vertex in enumerate(vertices):
            dense[i, :, vertex] += gradients[i, :, corner]
    expected = slope(x, lambda y: linearised(y, data)[0]).reshape(dense.shape)
    assert_allclose(dense, expected, rtol=0, atol=1e-6 * np.abs(dense).max())  # central difference


@pytest.mark.parametrize("name", NAMES)
def test_stiffness_is_symmetric_and_gives_no_energy_away(name):
    data = EXAMPLES[name]
    for amount in (0.0, 0.003, 0.03, 0.2):
        matrix = stiffness_of(crumpled(amount=amount, seed=3), data)
        assert_allclose(matrix, matrix.T, rtol=0, atol=1e-12 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() >= -1e-11 * np.abs(matrix).max()  # rounding


TAUT = sorted({"attachment", "chain", "curve", "green", "isometric", "membrane springs", "stretch"})


@pytest.mark.parametrize("name", TAUT)
def test_stiffness_of_what_is_taut_is_the_slope_of_the_force(name):
    """Where everything is pulled, what stress adds is whole; not where an angle or shear comes in."""
    data = EXAMPLES[name]
    x, y, _ = MESH.vertices.T
    pulled = np.column_stack([1.03 * x, 1.015 * y, np.zeros_like(x)])
    turned = pulled @ Rotation.from_rotvec([0.4, 0.7, -0.2]).as_matrix()
    exact = -slope(turned, lambda z: forces(z, data).ravel())
    found = stiffness_of(turned, data)
    assert_allclose(found, exact, rtol=0, atol=2e-6 * np.abs(exact).max())  # central difference


@pytest.mark.parametrize("damped", [0.0, 0.5])
@pytest.mark.parametrize("name", NAMES)
def test_exact_stiffness_is_the_slope_of_the_force(name, damped):
    """In any state: pushed, sheared and folded. Damping adds its share of what the material resists."""
    plain = EXAMPLES[name]
    data = plain._replace(damping=damped) if name not in WITHOUT_DAMPER else plain
    x = crumpled(amount=0.02, seed=5)
    stiffness = Stiffness(model_of((data,), np.ones(len(x))))
    found = to_scipy(stiffness.assemble_exact(x, damping_factor=1.0)).toarray()
    for column, way in enumerate(np.eye(x.size)):
        lacking = np.zeros_like(x)
        add_lacking(x, way.reshape(x.shape), (plain,), np.inf, lacking)
        found[:, column] += lacking.ravel()
    expected = -slope(x, lambda y: forces(y, plain).ravel(), step=1e-7)
    expected += to_scipy(stiffness.assemble(x, stiffness_factor=0.0, damping_factor=1.0)).toarray()
    assert_allclose(found, expected, rtol=0, atol=2e-6 * np.abs(expected).max())  # step², rounding


@pytest.mark.parametrize("name", sorted(set(NAMES) - MOVED_BY_SPACE))
def test_rigid_motion_costs_nothing_and_changes_nothing(name):
    data, x = EXAMPLES[name], crumpled()
    turn = Rotation.from_rotvec([0.3, -1.1, 2.0]).as_matrix()
    assert energy(x, data) > 1e-4
    assert_allclose(energy(x @ turn.T + 1.0, data), energy(x, data), rtol=1e-10)  # rounding at 1 m
    pull = forces(x, data)
    assert_allclose(pull.sum(axis=0), 0.0, rtol=0, atol=1e-12 * np.abs(pull).sum())  # no net force
    assert_allclose(np.cross(x, pull).sum(axis=0), 0.0, rtol=0, atol=1e-11 * np.abs(pull).sum())  # no net moment


def first_only(data):
    """The same kind with its first stencil only."""
    count = len(data.vertices)
    cut = {
        name: value[:1]
        for name, value in data._asdict().items()
        if isinstance(value, np.ndarray) and len(value) == count and name not in ("starts", "colours")
    }
    if "coupling" in data._fields:  # with itself only
        own = data.coupling[: data.first[1]][data.others[: data.first[1]] == 0]
        cut |= {"first": np.array([0, 1], np.int32), "others": np.zeros(1, np.int32), "coupling": own}
    return data._replace(**cut, starts=np.array([0, 1]), colours=np.array([0, 1]))


@njit
def sweep(x, start, inverse_mass, constraints, lambdas, h, times):
    for _ in range(times):
        prepare_all(x, constraints)
        project(x, start, inverse_mass, constraints, lambdas, h, False)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("h", [0.002, 0.02])
@pytest.mark.parametrize("damping", [0.0, 0.01])
def test_projections_end_at_implicit_euler(name, h, damping):
    """Also for a law that is not linear. XPBD lets gradients lag, so x is set anew from λ between its sweeps."""
    undamped = WITHOUT_DAMPER | {"hinge_moments"}  # whose sweeps damp by what stands for the stiffness
    data = first_only(EXAMPLES[name])._replace(damping=0.0 if name in undamped else damping)
    x = crumpled(amount=0.02, seed=5)
    inverse_mass, start = np.linspace(100.0, 30.0, len(x)), x + 1e-3 * crumpled(amount=1.0, seed=6)
    y, lambdas = x.copy(), multipliers((data,))
    for _ in range(200):
        sweep(y, start, inverse_mass, (data,), lambdas, h, 1)
        _, gradients, _ = linearised(y, data)
        y = x.copy()
        np.add.at(y, data.vertices, np.einsum("nb,nbsk->nsk", lambdas[0], gradients))
        y = x + inverse_mass[:, None] * (y - x)
    pull = forces(y, data)
    add_damping_forces(y, (y - start) / h, (data,), pull)
    assert np.linalg.norm(pull) > 1e-3
    left = (y - x) / (h * h) - inverse_mass[:, None] * pull
    assert_allclose(left, 0.0, rtol=0, atol=1e-6 * np.abs(inverse_mass[:, None] * pull).max())  # a fixed point, nearly


@pytest.mark.parametrize("name", sorted(set(NAMES) - WITHOUT_DAMPER))
def test_damping_takes_energy_and_no_momentum(name):
    data, x = EXAMPLES[name]._replace(damping=0.1), crumpled()
    v = np.random.default_rng(1).normal(size=x.shape)
    drag = np.zeros_like(x)
    add_damping_forces(x, v, (data,), drag)
    _, gradients, compliance = linearised(x, data)
    rate = np.einsum("nbsk,nsk->nb", gradients, v[data.vertices])
    loss = 0.1 * (rate * np.linalg.solve(compliance, rate[:, :, None])[:, :, 0]).sum()
    if name == "hinge_moments":  # the triangles' own, and not that of what stands for it
        _, gradients, compliance = linearised(x, EXAMPLES["shape_operator"])
        rate = np.einsum("nbsk,nsk->nb", gradients, v[EXAMPLES["shape_operator"].vertices])
        loss = 0.1 * (rate * np.linalg.solve(compliance, rate[:, :, None])[:, :, 0]).sum()
    assert loss > 0.0
    assert_allclose(-(drag * v).sum(), loss, rtol=1e-10)  # β ∇C v · α⁻¹ ∇C v
    if name not in MOVED_BY_SPACE:
        assert_allclose(drag.sum(axis=0), 0.0, rtol=0, atol=1e-11 * np.abs(drag).sum())


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("how", ["to a point", "to a line", "to a crease", "inside out", "a hundredfold"])
def test_degenerate_shapes_give_finite_results(name, how):
    data = EXAMPLES[name]
    shape = {
        "to a point": np.zeros((20, 3)),
        "to a line": MESH.vertices * [0.0, 1.0, 0.0],
        "to a crease": np.where(MESH.vertices[:, :1] > 0.15, MESH.vertices * [-1, 1, 1] + [0.3, 0, 0], MESH.vertices),
        "inside out": MESH.vertices * [-1.0, 1.0, 1.0],
        "a hundredfold": 100.0 * crumpled(),
    }[how]
    pull = forces(shape, data)
    assert np.isfinite(pull).all()
    assert np.isfinite(stiffness_of(shape, data)).all()
    x = shape.copy()
    sweep(x, shape, np.full(20, 100.0), (data,), multipliers((data,)), 0.01, 10)
    assert np.isfinite(x).all()
    assert np.abs(x).max() <= 10.0 * max(1.0, np.abs(shape).max())


def test_a_sheet_at_a_point_opens():
    """Threads without length take some direction, all the same one; so the sheet comes back to its size."""
    data = EXAMPLES["stretch"]
    solver = Xpbd(model_of((data,), np.full(20, 0.01), gravity=(0.0, 0.0, 0.0)), sweeps=20, damping=5.0)
    ended = solver.advance(at_rest(np.zeros((20, 3))), empty_contacts(20), 1e-3, 2000)
    assert energy(np.zeros((20, 3)), data) > 10.0
    assert energy(ended.positions, data) < 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_two_threads_give_the_same_bits(name):
    data, x = EXAMPLES[name], crumpled()
    results = []
    for threads in (1, 2):
        with limited_threads(threads):
            results.append((forces(x, data), *linearised(x, data)))
    for one, two in zip(*results, strict=True):
        assert_array_equal(one, two)
