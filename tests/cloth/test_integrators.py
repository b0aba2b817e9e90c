"""Integrators of forces: order of convergence, damping and drag against closed forms, memory, contacts, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from vto_pipeline.cloth.collision.contacts import ContactSpan, empty_contacts
from vto_pipeline.cloth.collision.shapes.colliders import Plane
from vto_pipeline.cloth.constraints.points.attachment import attachments
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.integrators.potential import IncrementalPotential
from vto_pipeline.cloth.integrators.system import ForceSystem
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.errors import ConfigError
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.linear.block_matrix import to_scipy
from vto_pipeline.units import GRAVITY

ORDER = {
    "explicit_euler": 1,
    "symplectic_euler": 1,
    "verlet": 2,
    "leapfrog": 2,
    "rk2": 2,
    "rk4": 4,
    "predictor_corrector": 2,
    "backward_euler": 1,
    "backward_euler_newton": 1,
    "implicit_midpoint": 2,
    "bdf2": 2,
    "newmark": 2,
    "imex": 1,
    "ncg": 1,
}
EXPLICIT = ["explicit_euler", "symplectic_euler", "verlet", "leapfrog", "rk2", "rk4", "predictor_corrector"]


def method_of(name, model, **settings):
    return INTEGRATORS[name](model, tolerance=1e-10, **settings)


def flag(*, rayleigh=0.0, pinned=(0, 3)):
    """A small soft sheet, strained and moving."""
    mesh = sheet(4, 4, 0.3, 0.3)
    cloth = fabric(stretch=3.0, shear=1.5, poisson=0.2, bending=1e-4)
    model = build_cloth(mesh, RestShape(mesh.vertices), cloth, pinned=pinned, materials=Materials(rayleigh=rayleigh))
    x, y, _ = mesh.vertices.T
    start = mesh.vertices * [1.02, 1.05, 1.0] + np.column_stack([0 * x, 0 * x, 0.02 * np.sin(8 * x) * y])
    velocities = np.column_stack([0.2 * y, 0.3 * x, 0.5 * np.cos(5 * y)])
    velocities[list(pinned)] = 0.0
    return model, ClothState(start, velocities)


def exactly(system, state, seconds):
    """The motion of the same forces by an eighth-order method of SciPy."""
    count = state.positions.size

    def slope(_, y):
        x, v = y[:count].reshape(-1, 3), y[count:].reshape(-1, 3)
        return np.concatenate([v.ravel(), system.acceleration(x, v).ravel()])

    start = np.concatenate([state.positions.ravel(), state.velocities.ravel()])
    found = solve_ivp(slope, (0.0, seconds), start, method="DOP853", rtol=1e-12, atol=1e-13)
    return found.y[:count, -1].reshape(-1, 3)


@pytest.mark.parametrize("damped", [False, True], ids=["free", "damped"])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_order_of_convergence(name, damped):
    model, state = flag(rayleigh=2e-3 if damped else 0.0)
    settings = {"damping": 1.5, "air": 0.5 * 1.2} if damped else {}
    seconds = 0.1
    errors = []
    reference = exactly(ForceSystem(model, **settings), state, seconds)
    for steps in (160, 320):
        end = method_of(name, model, **settings).advance(state, empty_contacts(16), seconds / steps, steps)
        assert_allclose(end.time, seconds, rtol=1e-12)  # rounding
        errors.append(np.abs(end.positions - reference).max())
    order = 1 if damped and name == "leapfrog" else ORDER[name]  # its damping is half a step late
    assert order - 0.25 < np.log2(errors[0] / errors[1]) < order + 0.5  # two step sizes, not the limit


def test_gradient_of_the_incremental_potential():
    model, state = flag(rayleigh=3e-3)
    system = ForceSystem(model, 2.0, 0.5 * 1.2 * 1.2)
    x, v = state.positions, state.velocities
    potential = IncrementalPotential.of_backward_euler(system, x, v, 0.01)
    y = x + 0.01 * v + np.random.default_rng(1).normal(0, 2e-3, x.shape) * system.free
    slope = np.zeros_like(x)
    for index in np.ndindex(x.shape):
        step = np.zeros_like(x)
        step[index] = 1e-6
        slope[index] = (potential.at(y + step)[0] - potential.at(y - step)[0]) / 2e-6
    gradient = potential.at(y)[1]
    assert not gradient[[0, 3]].any()  # held
    assert_allclose(gradient, system.free * slope, rtol=0, atol=1e-6 * np.abs(slope).max())  # step² and rounding


def test_matrix_is_the_slope_of_the_resistance():
    """With no elastic stress, what is left of the Hessian is exact."""
    mesh = sheet(4, 4, 0.3, 0.3)
    model = build_cloth(
        mesh, RestShape(mesh.vertices), fabric(bending=1e-4), pinned=(0,), materials=Materials(rayleigh=3e-3)
    )
    system = ForceSystem(model, 2.0, 0.5 * 1.2 * 1.2)
    x, v = mesh.vertices, np.random.default_rng(2).normal(0, 1, mesh.vertices.shape)
    rate = 40.0
    with_rate = to_scipy(system.matrix(x, v, 7.0, rate)).toarray()
    without = to_scipy(system.matrix(x, v, 7.0, 0.0)).toarray()
    slope = np.empty((48, 48))
    for column in range(48):
        step = np.zeros(48)
        step[column] = 1e-6
        plus, minus = (system.resistance(x, v + sign * step.reshape(-1, 3))[1] for sign in (1, -1))
        slope[:, column] = ((minus - plus) / 2e-6).ravel()
    slope[:3], slope[:, :3] = 0.0, 0.0
    assert_allclose(with_rate - without, rate * slope, rtol=0, atol=1e-6 * np.abs(rate * slope).max())  # step²
    assert_allclose(with_rate, with_rate.T, rtol=0, atol=1e-12 * np.abs(with_rate).max())  # rounding
    assert np.linalg.eigvalsh(with_rate).min() > 0.0


def plate(coefficient, name, *, damping=0.0, h=0.01, seconds=1.0):
    """Let a flat sheet fall face down, and return its speed."""
    mesh = sheet(4, 3, 0.3, 0.2, upright=False)
    mass = build_cloth(mesh, RestShape(mesh.vertices), fabric(density=0.15)).mass
    model = model_of((), mass, faces=mesh.faces)
    method = method_of(name, model, damping=damping, air=0.5 * 1.2 * coefficient)
    end = method.advance(at_rest(mesh.vertices), empty_contacts(12), h, round(seconds / h))
    assert_allclose(np.ptp(end.velocities, axis=0), 0.0, rtol=0, atol=1e-6)  # stays flat but for rounding
    return -end.velocities[:, 1].mean()


@pytest.mark.parametrize("name", INTEGRATORS)
def test_terminal_speed_of_a_flat_sheet(name):
    terminal = np.sqrt(2 * 0.15 * GRAVITY / (1.2 * 1.2))  # weight = ½ρ c v²
    at_end = terminal * np.tanh(GRAVITY * 0.1 / terminal)
    assert_allclose(plate(1.2, name, h=0.02, seconds=3.0), terminal, rtol=1e-9)  # tanh(20) is 1
    assert_allclose(plate(1.2, name, h=1e-3, seconds=0.1), at_end, rtol=6e-3)  # h g / v, where first order
    assert plate(0.0, name, h=1e-3, seconds=0.1) > 1.05 * at_end


@pytest.mark.parametrize("name", INTEGRATORS)
def test_mass_damping_slows_to_the_closed_form(name):
    alpha, h, seconds = 4.0, 1e-3, 0.5
    exact = GRAVITY / alpha * (1 - np.exp(-alpha * seconds))
    order_one = 0.5 * alpha * h  # relative, of the exponential
    assert_allclose(plate(0.0, name, damping=alpha, h=h, seconds=seconds), exact, rtol=order_one)
    assert abs(plate(0.0, name, damping=0.0, h=h, seconds=seconds) / exact - 1) > 0.5


@pytest.mark.parametrize("name", ["leapfrog", "bdf2", "predictor_corrector", "verlet"])
def test_a_method_with_memory_keeps_its_order_when_the_step_changes(name):
    model, state = flag()
    reference = exactly(ForceSystem(model), state, 0.1)

    def error(steps):
        method, now = method_of(name, model), state
        for share in (0.2, 0.5, 0.3):  # of the time, in different steps
            count = round(share * steps) * (2 if share == 0.5 else 1)
            now = method.advance(now, empty_contacts(16), share * 0.1 / count, count)
        return np.abs(now.positions - reference).max()

    assert 1.7 < np.log2(error(100) / error(200)) < 2.6  # second order


@pytest.mark.parametrize("name", INTEGRATORS)
def test_memory_does_not_leak_from_one_motion_into_another(name):
    model, state = flag()
    _, other = flag()
    other = ClothState(other.positions[::-1].copy(), np.zeros((16, 3)))
    method = INTEGRATORS[name](model)
    method.advance(other, empty_contacts(16), 1e-3, 5)
    again = method.advance(state, empty_contacts(16), 1e-3, 5)
    fresh = INTEGRATORS[name](model).advance(state, empty_contacts(16), 1e-3, 5)
    assert np.array_equal(again.positions, fresh.positions)
    assert np.array_equal(again.velocities, fresh.velocities)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_two_calls_are_one(name):
    damping = 0.0 if name == "leapfrog" else 1.0  # it damps by an older velocity within a call
    model, state = flag(rayleigh=1e-3 * damping)
    method = INTEGRATORS[name](model, damping=damping)
    two = method.advance(method.advance(state, empty_contacts(16), 1e-3, 4), empty_contacts(16), 1e-3, 6)
    one = INTEGRATORS[name](model, damping=damping).advance(state, empty_contacts(16), 1e-3, 10)
    assert_allclose(two.positions, one.positions, rtol=0, atol=1e-14)  # Newton's first guess differs in nothing
    assert not np.array_equal(one.positions, state.positions)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_plane_stops_what_falls(name):
    model = model_of((), np.array([0.3, 0.1]))
    floor = Plane((0, 0, 0), (0, 1, 0), 0.5)
    state = at_rest(np.array([[0, 0.02, 0], [0.1, 0.05, 0.0]]))
    method = INTEGRATORS[name](model)
    for _ in range(40):
        span = ContactSpan(state.time, state.time + 0.02, 0.1, np.zeros(2), 0.5)
        state = method.advance(state, floor.contacts(state.positions, span), 0.005, 4)
    assert_allclose(state.positions, [[0, 0, 0], [0.1, 0, 0]], rtol=0, atol=1e-12)  # on the plane, to rounding
    assert np.abs(state.velocities).max() < 1.01 * 0.005 * GRAVITY  # what a step of gravity gives


@pytest.mark.parametrize("name", INTEGRATORS)
def test_an_attachment_bears_a_cloth_that_nothing_else_holds(name):
    """What acts from outside must not be taken for an internal force, whose sum over the cloth is nothing."""
    points, target = np.array([[0.0, 0, 0], [0.2, 0, 0]]), np.array([[0.0, 0.1, 0], [0.2, 0.1, 0]])
    model = model_of((attachments([0, 1], target, points, [0.01, 0.02]),), np.array([0.5, 0.3]))
    end = method_of(name, model, damping=20.0).advance(at_rest(points), empty_contacts(2), 0.01, 400)
    weight = model.mass * GRAVITY
    hanging = target - np.column_stack([[0, 0], weight * [0.01, 0.02], [0, 0]])
    assert_allclose(end.positions, hanging, rtol=0, atol=1e-10)  # 40 or more time constants; tolerance of Newton


@pytest.mark.parametrize("name", INTEGRATORS)
def test_no_vertex_outruns_the_limit(name):
    model, state = flag()
    free = np.setdiff1d(np.arange(16), [0, 3])
    fast = ClothState(state.positions, 5.0 * state.velocities)
    end = INTEGRATORS[name](model, max_speed=0.1).advance(fast, empty_contacts(16), 1e-3, 10)
    moved = np.linalg.norm(end.positions - fast.positions, axis=1)
    assert moved[free].max() > 0.5 * 0.1 * 0.01
    assert moved.max() <= 0.1 * 0.01 * (1 + 1e-12)  # ten steps of a millisecond; rounding


@pytest.mark.parametrize("name", INTEGRATORS)
def test_rigid_constraints_are_refused(name):
    model, state = flag()
    rigid = tuple(
        data._replace(compliance=np.zeros_like(data.compliance)) if type(data).__name__ == "Stretch" else data
        for data in model.constraints
    )
    with pytest.raises(ConfigError, match="stretch constraints.*rigid") as refused:
        INTEGRATORS[name](replace(model, constraints=rigid)).advance(state, empty_contacts(16), 1e-3, 1)
    assert "xpbd" in refused.value.hint


def test_implicit_methods_stand_a_large_step():
    """Where the stability limit of explicit ones is passed a hundred times."""
    mesh = sheet(6, 6, 0.3, 0.3)
    stiff = build_cloth(mesh, RestShape(mesh.vertices), fabric(stretch=1e5, shear=2e4), pinned=(0, 5))
    lightest = stiff.mass.min()
    h = 1 / 30
    assert h * np.sqrt(1e5 / lightest) > 200.0
    for name in ("backward_euler", "backward_euler_newton", "imex", "ncg", "bdf2"):
        end = INTEGRATORS[name](stiff, damping=5.0).advance(at_rest(mesh.vertices), empty_contacts(36), h, 90)
        assert_allclose(end.positions, mesh.vertices, rtol=0, atol=5e-3)  # a stiff sheet hangs as it was
    with np.errstate(all="ignore"):
        for name in EXPLICIT:
            end = INTEGRATORS[name](stiff).advance(at_rest(mesh.vertices), empty_contacts(36), h, 90)
            assert not np.abs(end.positions).max() < 1e3  # beyond the limit, as it must be
