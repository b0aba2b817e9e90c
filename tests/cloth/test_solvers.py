"""All solvers end in the minimum of one implicit step, each by its own way, and the wrong one does not."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import root

from vto_pipeline.cloth.collision.contacts import ContactSpan, empty_contacts, gather_contacts
from vto_pipeline.cloth.collision.shapes.colliders import Plane, Sphere
from vto_pipeline.cloth.constraints.points.combination import combinations
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.constraints.sweep import add_forces
from vto_pipeline.cloth.implicit_step.frozen_step import frozen_step, residual_history, rms
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.solvers import SOLVERS
from vto_pipeline.cloth.solvers.fast_projection import FastProjection
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.cpu_threads import limited_threads

GRAVITY = 9.81
SAME = 1e-6  # m: how far apart solvers may end
SWEEPS = {"newton": 60, "fast_projection": 30, "projective": 300, "vertex_descent": 500, "plain_jacobi": 4000}
WITH_MULTIPLIERS = [
    "xpbd",
    "gauss_seidel",
    "jacobi",
    "plain_jacobi",
    "chebyshev",
    "conjugate_residual",
    "anderson",
    "fast_projection",
]
EXACT = [name for name in SOLVERS if name not in ("xpbd", "pbd_soft")]


def cloth(side, pinned=(), upright=True, rayleigh=0.0, gravity=(0.0, -GRAVITY, 0.0), stretch=3000.0):
    mesh = sheet(side, side, 0.06 * (side - 1), 0.06 * (side - 1), upright)
    stiff = fabric(stretch=stretch, shear=stretch / 3.0, poisson=0.2, bending=1e-5, density=0.15)
    materials = Materials(rayleigh=rayleigh)
    model = build_cloth(mesh, RestShape(mesh.vertices), stiff, pinned=pinned, gravity=gravity, materials=materials)
    return model, mesh.vertices


def falling(side, h, rayleigh=0.0):
    """A sheet held by two corners that swings and ripples."""
    model, rest = cloth(side, (0, side - 1), rayleigh=rayleigh)
    x = rest + np.column_stack([np.zeros(len(rest)), np.zeros(len(rest)), 0.02 * np.sin(9.0 * rest[:, 0])])
    speed = np.column_stack([0.3 * np.sin(7.0 * rest[:, 1]), -0.5 + rest[:, 0], 2.0 * rest[:, 1]])
    speed[[0, side - 1]] = 0.0
    return frozen_step(model, ClothState(x, speed), h)


def landing(side, h):
    """A flat sheet that hits a ball."""
    model, rest = cloth(side, upright=False)
    middle = rest.mean(axis=0)
    ball = Sphere((middle[0], -2.0, middle[2]), 2.0, 0.5)
    x = rest + np.array([0.0, 1e-3, 0.0])
    return frozen_step(model, ClothState(x, np.tile([0.2, -1.5, 0.0], (len(x), 1))), h, [ball], 1e-3)


def gradient_of(step, x):
    """Of |x - x̃|²_M / 2 h² + E, by the definition; zero at the solution where nothing is touched."""
    forces = np.zeros_like(x)
    add_forces(x, step.model.constraints, forces)
    free = step.model.inverse_mass[:, None] > 0.0
    flight = step.state.positions + step.h * step.state.velocities + step.h**2 * step.model.gravity
    return np.where(free, step.model.mass[:, None] * (x - flight) / step.h**2 - forces, 0.0)


def advanced(name, step, sweeps=None):
    sweeps = SWEEPS.get(name, 1000) if sweeps is None else sweeps
    return SOLVERS[name](step.model, sweeps=sweeps).advance(step.state, step.contacts, step.h, 1).positions


@pytest.fixture(scope="module")
def by_scipy():
    """A step, and its solution by MINPACK's hybrid method from finite differences of nothing but the forces."""
    step = falling(5, 1.0 / 240.0)
    free = step.model.inverse_mass > 0.0

    def reduced(values):
        x = step.state.positions.copy()
        x[free] = values.reshape(-1, 3)
        return gradient_of(step, x)[free].ravel()

    found = root(reduced, step.free_flight[free].ravel(), method="hybr", options={"xtol": 1e-13, "maxfev": 20000})
    x = step.state.positions.copy()
    x[free] = found.x.reshape(-1, 3)
    assert step.imbalance(x) < 1e-9
    return step, x


@pytest.mark.parametrize("name", EXACT)
def test_every_solver_ends_where_scipy_does(name, by_scipy):
    step, solution = by_scipy
    assert rms(step.free_flight - solution, step.model) > 2e-4  # there is something to solve
    assert_allclose(advanced(name, step), solution, rtol=0, atol=SAME)


@pytest.fixture(scope="module", params=[falling, landing])
def solved(request):
    step = request.param(12, 1.0 / 480.0)
    solution = FastProjection(step.model, sweeps=40).advance(step.state, step.contacts, step.h, 1).positions
    assert step.imbalance(solution) < 1e-9  # by forces and planes alone
    assert rms(step.free_flight - solution, step.model) > 1e-4
    return request.param, solution


@pytest.mark.parametrize("name", EXACT)
def test_every_solver_ends_in_the_same_point(name, solved):
    scene, solution = solved
    step = scene(12, 1.0 / 480.0)
    assert rms(advanced(name, step) - solution, step.model) < SAME


def test_planes_push_in_that_point():
    step = landing(12, 1.0 / 480.0)
    x = advanced("fast_projection", step)
    pushed = gradient_of(step, x)
    away = x - [0.33, -2.0, 0.33]
    touched = np.linalg.norm(pushed, axis=1) > 1e-6
    assert 3 <= touched.sum() <= 60
    outward = (pushed * away).sum(axis=1) / np.linalg.norm(away, axis=1)
    assert_allclose(outward[touched], np.linalg.norm(pushed[touched], axis=1), rtol=2e-2)  # planes ride from the start


@pytest.mark.parametrize("name", ["gauss_seidel", "conjugate_residual", "projective", "vertex_descent"])
def test_damping_has_its_part_in_it(name):
    plain, damped = falling(8, 1.0 / 480.0), falling(8, 1.0 / 480.0, rayleigh=2e-3)
    solution = advanced("fast_projection", damped)
    assert damped.imbalance(solution) < 1e-8
    assert plain.imbalance(solution) > 1e-5
    assert rms(advanced(name, damped) - solution, damped.model) < SAME


def test_xpbd_ends_beside_it_by_how_far_gradients_turn():
    apart = []
    for h in (1.0 / 240.0, 1.0 / 480.0, 1.0 / 960.0, 1.0 / 1920.0):
        step = falling(8, h)
        apart.append(rms(advanced("xpbd", step, 4000) - advanced("fast_projection", step), step.model))
    shrink = np.array(apart[:-1]) / apart[1:]
    assert (shrink > 3.0).all()  # about h² and more
    assert (shrink < 40.0).all()  # at most h⁵
    assert apart[-1] < SAME


def test_without_the_memory_of_multipliers_the_point_is_another():
    step = falling(8, 1.0 / 480.0)
    assert_array_equal(advanced("pbd_soft", step, 1), advanced("xpbd", step, 1))  # with one sweep nothing is forgotten
    solution = advanced("fast_projection", step)
    few, many = (rms(advanced("pbd_soft", step, sweeps) - solution, step.model) for sweeps in (100, 4000))
    assert few > 20.0 * SAME
    assert many > few


def linear_problem():
    """Weighted sums of vertices, so the constraints are linear; and A, D and r by dense algebra."""
    rng = np.random.default_rng(3)
    count, rows, h = 30, 40, 0.01
    x, mass = rng.normal(size=(count, 3)), rng.uniform(0.5, 2.0, count)
    vertices = np.array([rng.choice(count, 4, replace=False) for _ in range(rows)], dtype=np.int32)
    weights, targets = rng.normal(size=(rows, 4)), rng.normal(size=(rows, 3))
    compliance = rng.uniform(1e-5, 1e-4, rows)
    model = model_of((combinations(vertices, weights, targets, compliance, x, 0.0),), mass, gravity=(0.0, 0.0, 0.0))
    jacobian = np.zeros((rows, count))
    for row in range(rows):
        jacobian[row, vertices[row]] = weights[row]
    matrix = jacobian / mass @ jacobian.T + np.diag(compliance) / h**2
    scaled = matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    right = (targets - jacobian @ x) / np.sqrt(np.diag(matrix))[:, None]
    return frozen_step(model, at_rest(x), h), np.kron(scaled, np.eye(3)), right.ravel(), mass.sum()


def test_conjugate_residuals_are_monotone_and_smallest_on_a_linear_system():
    step, matrix, right, mass = linear_problem()
    history = list(residual_history(SOLVERS["conjugate_residual"], step, range(1, 31), step.free_flight))
    found = np.array([reached.constraint for reached in history])
    basis, vector, smallest = [], right, []
    for _ in range(8):
        basis.append(vector / np.linalg.norm(vector))
        space = matrix @ np.linalg.qr(np.array(basis).T)[0]
        left = right - space @ np.linalg.lstsq(space, right, rcond=None)[0]
        smallest.append(np.linalg.norm(left) / np.sqrt(mass))
        vector = matrix @ basis[-1]
    assert_allclose(found[:8], smallest, rtol=1e-6)  # the least residual in the Krylov space, while its basis is good
    assert (np.diff(found) < 0.0).all()
    assert found[-1] < 1e-4 * found[0]
    assert found[0] < np.linalg.norm(right) / np.sqrt(mass)


def test_momentum_needs_fewer_iterations_than_plain_jacobi():
    step = falling(12, 1.0 / 240.0)
    solution = advanced("fast_projection", step)
    plain, with_momentum, chebyshev, residuals = (
        rms(advanced(name, step, 128) - solution, step.model)
        for name in ("plain_jacobi", "jacobi", "chebyshev", "conjugate_residual")
    )
    assert with_momentum < 0.25 * plain
    assert chebyshev < 0.25 * plain
    assert residuals < with_momentum


@pytest.mark.parametrize("name", [*WITH_MULTIPLIERS, "pbd_soft"])
def test_linear_momentum_is_kept_to_rounding(name):
    model, rest = cloth(6, gravity=(0.0, 0.0, 0.0))
    rng = np.random.default_rng(1)
    state = ClothState(rest + rng.normal(0.0, 0.01, rest.shape), rng.normal(0.0, 1.0, rest.shape))
    after = SOLVERS[name](model, sweeps=40).advance(state, empty_contacts(len(rest)), 1.0 / 480.0, 5)
    before = model.mass @ state.velocities
    scale = model.mass @ np.linalg.norm(state.velocities, axis=1)
    assert np.abs(after.velocities - state.velocities).max() > 0.1  # forces have acted
    assert_allclose(model.mass @ after.velocities, before, rtol=0, atol=1e-11 * scale)  # rounding of x over h


@pytest.mark.parametrize("name", WITH_MULTIPLIERS)
def test_rigid_rods_are_held(name):
    x = np.column_stack([np.linspace(0.0, 0.4, 5), np.zeros((5, 2))])
    rods = springs([[0, 1], [1, 2], [2, 3], [3, 4]], x, 0.0)
    model = model_of((rods,), np.full(5, 0.1), pinned=(0,))
    after = SOLVERS[name](model, sweeps=300).advance(at_rest(x), empty_contacts(5), 1.0 / 240.0, 3).positions
    assert after[-1, 1] < -1e-4  # it swings
    lengths = np.linalg.norm(np.diff(after, axis=0), axis=1)
    assert_allclose(lengths, 0.1, rtol=0, atol=1e-6)  # what 300 iterations leave of the slowest


@pytest.mark.parametrize("name", ["projective", "vertex_descent"])
def test_methods_that_need_a_stiffness_say_so(name):
    x = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    model = model_of((springs([[0, 1]], x, 0.0),), np.ones(2))
    with pytest.raises(ConfigError, match="rigid"):
        SOLVERS[name](model, sweeps=1).advance(at_rest(x), empty_contacts(2), 0.01, 1)


@pytest.mark.parametrize("name", [name for name in SOLVERS if name != "newton"])
@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_friction_on_a_slope(name, friction):
    model, rest = cloth(4, upright=False, stretch=100.0)  # soft: vertex by vertex, a stiff sheet slides off slowly
    slope = np.radians(20.0)
    turn = np.array([[np.cos(slope), -np.sin(slope), 0.0], [np.sin(slope), np.cos(slope), 0.0], [0.0, 0.0, 1.0]])
    down, normal = -turn[:, 0], turn[:, 1]
    state, h, steps = at_rest(rest @ turn.T), 1.0 / 240.0, 24
    solver = SOLVERS[name](model, sweeps=8 if name == "fast_projection" else 100)
    plane = Plane((0.0, 0.0, 0.0), tuple(normal), friction)
    for _ in range(steps):
        span = ContactSpan(state.time, state.time + h, 0.05, np.zeros(len(rest)), 1.0)
        state = solver.advance(state, gather_contacts([plane], state.positions, span), h, 1)
    speed = model.mass @ state.velocities @ down / model.mass.sum()
    expected = max(0.0, GRAVITY * (np.sin(slope) - friction * np.cos(slope))) * steps * h
    assert_allclose(speed, expected, rtol=1e-2, atol=1e-6)  # Coulomb: what the sheet's own motion leaves to chance
    assert abs((state.positions @ normal).min()) < 1e-9


@pytest.mark.parametrize("name", SOLVERS)
def test_the_same_bits_with_one_thread_and_two(name):
    mesh = sheet(52, 52, 0.5, 0.5)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(bending=1e-5), pinned=(0, 51))
    state = ClothState(mesh.vertices, np.random.default_rng(0).normal(0.0, 0.2, mesh.vertices.shape))
    ends = []
    for threads in (1, 2):
        with limited_threads(threads):
            ends.append(
                SOLVERS[name](model, sweeps=2).advance(state, empty_contacts(len(mesh.vertices)), 1.0 / 240.0, 1)
            )
    assert_array_equal(ends[0].positions, ends[1].positions)
    assert np.isfinite(ends[0].positions).all()
