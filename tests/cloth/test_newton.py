"""Backward Euler in large steps: against a minimum by SciPy, closed forms of motion and friction, and energy."""

import numpy as np
import pytest
from cloth_scenes import bead_on_floor, fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.optimize import minimize, root

from vto_pipeline.cloth.collision.contacts import Contacts, ContactSpan, empty_contacts, gather_contacts
from vto_pipeline.cloth.collision.response.contact_springs import add_contacts, update_active_set
from vto_pipeline.cloth.collision.shapes.colliders import Plane, Sphere
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.constraints.sweep import add_damping_forces, add_forces
from vto_pipeline.cloth.integrators import INTEGRATORS
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.solvers import newton
from vto_pipeline.cloth.solvers.newton import Limits, Newton
from vto_pipeline.model.garment import RestShape

G = 9.81
FRAME = 1.0 / 60.0
RAISED, THROWN = np.array([0.0, 0.01, 0.0]), np.array([1.0, -1.0, 0.0])


def cloth(side, pinned=(), *, upright=True, gravity=(0.0, -G, 0.0), stretch=500.0, width=0.3, **modelled):
    mesh = sheet(side, side, width, width, upright)
    stuff = fabric(stretch=stretch, shear=0.3 * stretch, poisson=0.2, bending=1e-5, density=0.15)
    materials = Materials(**{"rayleigh": 0.0} | modelled)
    model = build_cloth(mesh, RestShape(mesh.vertices), stuff, pinned=pinned, gravity=gravity, materials=materials)
    return model, mesh.vertices


def energy(model, state):
    """Elastic, kinetic and of height [J]."""
    elastic = add_forces(state.positions, model.constraints, np.zeros_like(state.positions))
    kinetic = 0.5 * model.mass @ (state.velocities**2).sum(axis=1)
    return elastic + kinetic - model.mass @ (state.positions @ model.gravity)


def stirred(side=4, pinned=(0, 3), **settings):
    """A sheet that is strained and moves."""
    model, rest = cloth(side, pinned, **settings)
    rng = np.random.default_rng(0)
    x, v = rest + rng.normal(0.0, 2e-3, rest.shape), rng.normal(0.0, 0.5, rest.shape)
    x[list(pinned)], v[list(pinned)] = rest[list(pinned)], 0.0
    return model, ClothState(x, v)


def test_a_step_with_the_exact_stiffness_is_taken_where_its_system_is_positive_definite():
    """A bead between two springs that are pressed to half their length: across, they push with -2k, inertia m/h²."""
    x, stiffness, mass = np.array([[-0.5, 0, 0], [0, 0, 0], [0.5, 0, 0]]), 3.0, 0.01
    model = model_of((springs([[0, 1], [1, 2]], 2.0 * x, 1.0 / stiffness),), np.full(3, mass), pinned=(0, 2))
    longest = np.sqrt(mass / (2.0 * stiffness))
    for share, taken in ((0.9, 1), (1.1, 0)):
        method = Newton(model)
        method.exact = True
        known = method.active
        state = ClothState(x, np.array([[0, 0, 0], [0, 1e-3, 0], [0, 0, 0]]))
        after = method.advance(state, empty_contacts(3), share * longest, 2)
        assert method.definite == bool(taken)
        assert after.time == pytest.approx(2 * taken * share * longest)
        if not taken:
            assert_array_equal(after.positions, state.positions)
            assert_array_equal(after.velocities, state.velocities)
            assert method.active is known


@pytest.mark.parametrize("circles", [False, True])
def test_a_step_with_the_exact_stiffness_is_taken_where_its_contacts_come_to_an_end(monkeypatch, circles):
    """A bead presses on a floor; where contacts would go on changing, it is left where it was, and that soon."""
    model, state, contacts = bead_on_floor(2e-3, [0.0, -0.1, 0.0])
    asked = []

    def changed(*args):
        asked.append(update_active_set(*args))
        return 1.0 if circles else asked[-1]

    monkeypatch.setattr(newton, "update_active_set", changed)
    method = Newton(model)
    method.exact = True
    after = method.advance(state, contacts, FRAME, 1)
    assert method.definite is not circles
    assert (after.time == 0.0) is circles
    assert (after.positions == state.positions).all() == circles
    assert 0 < len(asked) < 10


@pytest.mark.parametrize("exact", [False, True])
def test_pairs_are_as_stiff_as_the_cloth_in_steps_with_the_exact_stiffness(monkeypatch, exact):
    model, state, contacts = bead_on_floor(2e-3, [0.0, -0.1, 0.0])
    firm = []
    monkeypatch.setattr(newton, "add_contacts", lambda *args: firm.append(args[-1]) or add_contacts(*args))
    method = Newton(model)
    method.exact = exact
    method.advance(state, contacts, FRAME, 1)
    assert set(firm) == {exact}


def by_scipy(model, state, h):
    """The minimum of ½ |y - x̃|²_M / h² + E(y), to rounding."""
    free = model.inverse_mass > 0.0
    target = state.positions + h * state.velocities + h * h * model.gravity

    def slope(values):
        y = state.positions.copy()
        y[free] = values.reshape(-1, 3)
        forces = model.mass[:, None] * (target - y) / (h * h)
        value = add_forces(y, model.constraints, forces)
        value += 0.5 * model.mass[free] @ ((y - target)[free] ** 2).sum(axis=1) / (h * h)
        return value, -forces[free].ravel()

    found = minimize(slope, target[free].ravel(), jac=True, method="BFGS", options={"gtol": 1e-9, "maxiter": 3000})
    exact = root(lambda values: slope(values)[1], found.x, method="hybr", options={"xtol": 1e-14, "maxfev": 3000})
    assert slope(exact.x)[0] <= found.fun + 1e-12
    y = state.positions.copy()
    y[free] = exact.x.reshape(-1, 3)
    return y


@pytest.mark.parametrize("h", [1.0 / 240.0, FRAME])
def test_a_step_of_many_iterations_ends_in_the_minimum(h):
    model, state = stirred()
    expected = by_scipy(model, state, h)
    far = np.abs(expected - state.positions - h * state.velocities - h * h * model.gravity)[4:].max()
    assert far > 1e-3  # forces have acted
    after = Newton(model, sweeps=20).advance(state, empty_contacts(16), h, 1)
    assert_allclose(after.positions, expected, rtol=0, atol=1e-8)
    assert_allclose(after.velocities, (after.positions - state.positions) / h, rtol=0, atol=1e-12)


def test_one_iteration_is_near_it():
    model, state = stirred()
    expected = by_scipy(model, state, FRAME)
    one = Newton(model).advance(state, empty_contacts(16), FRAME, 1).positions
    flight = state.positions + FRAME * state.velocities + FRAME**2 * model.gravity
    free = model.inverse_mass > 0.0
    assert np.linalg.norm((one - expected)[free]) < 0.5 * np.linalg.norm((flight - expected)[free])


@pytest.mark.parametrize(("bending", "share"), [("hinge", 1e-6), ("shape_operator", 1e-3)])
def test_damped_steps_solve_their_equation(bending, share):
    """M (y - x̃) / h² = f(y) - β K(y) (y - x) / h, by forces alone."""
    h = 1.0 / 240.0
    model, state = stirred(rayleigh=0.01, bending=bending)
    plain = Newton(stirred(bending=bending)[0], sweeps=20).advance(state, empty_contacts(16), h, 1).positions
    found = Newton(model, sweeps=20).advance(state, empty_contacts(16), h, 1).positions
    target = state.positions + h * state.velocities + h * h * model.gravity

    def left(y):
        forces = model.mass[:, None] * (target - y) / (h * h)
        add_forces(y, model.constraints, forces)
        add_damping_forces(y, (y - state.positions) / h, model.constraints, forces)
        return np.linalg.norm(forces[model.inverse_mass > 0.0])

    assert left(plain) > 0.3 * left(state.positions)
    # 19 iterations that leave a third each, at least; seven tenths where a stiffness stands for the exact one
    assert left(found) < share * left(state.positions)


@pytest.mark.parametrize("h", [5e-4, 2e-3, FRAME])
@pytest.mark.parametrize("rayleigh", [0.01, 0.1])
def test_dampers_do_not_stall_a_step(rayleigh, h, monkeypatch):
    """Newton converges quadratically: a few iterations leave next to nothing of the forces that set it in motion."""
    model, state = stirred(8, (0, 7), rayleigh=rayleigh)
    method, iterations, once = Newton(model), [], Newton._iterate
    monkeypatch.setattr(method, "_iterate", lambda *a, **k: iterations.append(1) or once(method, *a, **k))
    method.exact = True
    after = method.advance(state, empty_contacts(64), h, 1)
    if not method.definite:  # no such step is taken: it buckles
        method.exact = False
        after = method.advance(state, empty_contacts(64), h, 1)
    y = after.positions

    def unbalanced(y):
        forces = model.mass[:, None] * (state.positions + h * state.velocities + h * h * model.gravity - y) / (h * h)
        add_forces(y, model.constraints, forces)
        add_damping_forces(y, (y - state.positions) / h, model.constraints, forces)
        return np.linalg.norm(forces[model.inverse_mass > 0.0])

    assert unbalanced(y) < 0.03 * unbalanced(state.positions + h * state.velocities)
    assert len(iterations) <= 5


def test_free_fall_is_exact():
    model, rest = cloth(6)
    v = np.broadcast_to([0.3, 1.0, -0.2], rest.shape)
    after = Newton(model).advance(ClothState(rest, v), empty_contacts(36), FRAME, 30)
    fall = G * FRAME**2 * 30 * 31 / 2
    assert_allclose(after.positions - rest, 0.5 * v - [0.0, fall, 0.0], rtol=0, atol=1e-11)  # rounding of 30 steps
    assert_allclose(after.velocities, v - [0.0, 0.5 * G, 0.0], rtol=0, atol=1e-9)
    assert_allclose(after.time, 0.5, rtol=1e-12)


def test_velocities_fade_at_the_rate_given():
    model = model_of((), np.ones(3), gravity=(0.0, 0.0, 0.0))
    start = ClothState(np.zeros((3, 3)), np.ones((3, 3)))
    after = Newton(model, damping=2.0).advance(start, empty_contacts(3), FRAME, 30)
    assert_allclose(after.velocities, np.exp(-1.0), rtol=1e-12)


def test_no_vertex_outruns_the_limit():
    model, state = stirred()
    after = Newton(model, max_speed=0.1).advance(state, empty_contacts(16), FRAME, 1)
    speed = np.linalg.norm(after.velocities, axis=1)
    assert_allclose(speed.max(), 0.1, rtol=1e-9)


def test_linear_momentum_is_kept():
    model, state = stirred(side=12, pinned=())
    before = model.mass @ state.velocities
    after = Newton(model).advance(state, empty_contacts(144), FRAME, 20)
    scale = model.mass @ np.linalg.norm(state.velocities, axis=1)
    expected = before + model.mass.sum() * 20 * FRAME * model.gravity
    assert np.abs(after.velocities - state.velocities).max() > 0.5
    assert_allclose(model.mass @ after.velocities, expected, rtol=0, atol=1e-11 * scale)  # rounding of x / h


def test_a_swinging_sheet_keeps_the_energy_that_backward_euler_keeps():
    model, rest = cloth(12, (0, 11), upright=False)
    ends, start = {}, at_rest(rest)
    for h in (FRAME, 0.25 * FRAME):
        converged = INTEGRATORS["backward_euler_newton"](model).advance(start, empty_contacts(144), h, round(0.2 / h))
        ours = Newton(model).advance(start, empty_contacts(144), h, round(0.2 / h))
        lost = energy(model, start) - energy(model, converged)
        fallen = model.mass @ (start.positions - converged.positions)[:, 1] * G
        assert 0.01 * fallen < lost < 0.6 * fallen  # there is something to compare
        assert_allclose(energy(model, start) - energy(model, ours), lost, rtol=0, atol=0.05 * fallen)
        ends[h] = lost / fallen
    assert ends[0.25 * FRAME] < 0.5 * ends[FRAME]  # of first order


@pytest.mark.parametrize("h", [FRAME, 0.25 * FRAME])
def test_energy_is_never_above_the_start(h):
    model, state = stirred(side=10, pinned=(0, 9))
    method, highest = Newton(model), energy(model, state)
    for _ in range(40):
        state = method.advance(state, empty_contacts(100), h, 1)
        now = energy(model, state)
        assert now <= highest * (1.0 + 1e-9)
        highest = now


def test_a_stiff_rod_swings_as_a_pendulum():
    """One linear step would all but hold it: what is stiff along its length is not stiff across."""
    length, h = 0.5, FRAME
    x = np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])
    model = model_of((springs([[0, 1]], x, 1e-8),), np.array([1.0, 0.2]), pinned=(0,))
    state, method = at_rest(x), Newton(model)
    path = []
    for _ in range(30):
        state = method.advance(state, empty_contacts(2), h, 1)
        path.append(state.positions[1])
    path = np.array(path)
    assert_allclose(np.linalg.norm(path, axis=1), length, rtol=1e-4)
    found = solve_ivp(lambda _, y: [y[1], G / length * np.cos(y[0])], (0, 30 * h), [0, 0], rtol=1e-10, max_step=h)
    exact = np.interp(h * np.arange(1, 31), found.t, found.y[0])
    angle = np.unwrap(np.arctan2(-path[:, 1], path[:, 0]))
    down = exact < 0.5 * np.pi
    assert_allclose(angle[down], exact[down], rtol=0, atol=0.12)  # of first order: h times the fastest turn, halved
    assert angle.max() > 0.5 * np.pi + 0.3  # and up on the other side


# ---------------------------------------------------------------------------------------------------------- contacts


def on_plane(state, normal, friction, *, h, skin=0.0):
    span = ContactSpan(state.time, state.time + h, 0.05, np.full(len(state.positions), skin), 1.0)
    return gather_contacts([Plane((0.0, 0.0, 0.0), tuple(normal), friction)], state.positions, span)


def slope_run(method, rest, slope, friction, h, steps):
    turn = np.array([[np.cos(slope), -np.sin(slope), 0.0], [np.sin(slope), np.cos(slope), 0.0], [0.0, 0.0, 1.0]])
    state = start = at_rest(rest @ turn.T)
    for _ in range(steps):
        state = method.advance(state, on_plane(state, turn[:, 1], friction, h=h), h, 1)
    return (state.positions - start.positions) @ turn, state.velocities @ turn


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("h", [FRAME, 0.1 * FRAME])
def test_slides_down_a_slope(friction, h):
    model, rest = cloth(6, upright=False)
    slope, steps = np.arctan(1.2 * friction + 0.05), round(0.5 / h)
    moved, speed = slope_run(Newton(model), rest, slope, friction, h, steps)
    down = G * (np.sin(slope) - friction * np.cos(slope))
    assert_allclose(-moved[:, 0], down * h * h * steps * (steps + 1) / 2, rtol=0.01)  # its first step has to find μN
    assert_allclose(-speed[:, 0], down * h * steps, rtol=0.01)
    assert_allclose(moved[:, 1], 0.0, rtol=0, atol=1e-5)  # sinks by g h² / 1000 at most
    assert_allclose(moved[:, 2], 0.0, rtol=0, atol=5e-3 * abs(moved[:, 0]).max())  # Poisson's ratio, as it starts


@pytest.mark.parametrize("speed", [0.5, 3.0, 10.0])
def test_friction_slows_cloth_of_any_speed_alike(speed):
    model, rest = cloth(6, upright=False)
    state, method, friction, steps = ClothState(rest, np.tile([speed, 0.0, 0.0], (36, 1))), Newton(model), 0.3, 6
    for _ in range(steps):
        state = method.advance(state, on_plane(state, (0.0, 1.0, 0.0), friction, h=FRAME), FRAME, 1)
    assert_allclose(speed - state.velocities[:, 0], friction * G * steps * FRAME, rtol=5e-3)


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("h", [FRAME, 0.1 * FRAME])
def test_holds_on_a_slope(friction, h):
    model, rest = cloth(6, upright=False)
    moved, speed = slope_run(Newton(model), rest, np.arctan(0.95 * friction), friction, h, round(0.5 / h))
    assert_allclose(moved, 0.0, rtol=0, atol=1e-5)
    assert_allclose(speed, 0.0, rtol=0, atol=1e-4)


def landings(friction, state, model, steps):
    """What a plane does to a cloth in each step [N], shape (steps, 3): inner forces cancel in the sum."""
    method, forces = Newton(model), []
    for _ in range(steps):
        contacts = on_plane(state, (0.0, 1.0, 0.0), friction, h=FRAME)
        after = method.advance(state, contacts, FRAME, 1)
        assert (after.positions[:, 1] > -1e-9).all()
        forces.append(model.mass @ ((after.velocities - state.velocities) / FRAME - model.gravity))
        state = after
    return np.array(forces), state


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.8])
def test_a_plane_pushes_and_holds_within_the_cone(friction):
    """Cones of one plane add up to one; how hard it pushes is what friction knows of the step before."""
    model, rest = cloth(10, upright=False)
    state = ClothState(rest + RAISED, np.tile(THROWN, (100, 1)))
    forces, after = landings(friction, state, model, 40)
    weight = G * model.mass.sum()
    normal, along = forces[:, 1], np.hypot(forces[:, 0], forces[:, 2])
    assert (normal > -1e-6 * weight).all()
    assert normal.max() > 3.0 * weight  # it landed
    before = np.maximum(normal, np.append(0.0, normal[:-1]))
    assert (along <= friction * before + 0.02 * weight).all()
    slowed = model.mass.sum() * (1.0 - (model.mass @ after.velocities[:, 0]) / model.mass.sum())
    expected = min(model.mass.sum(), friction * normal.sum() * FRAME)  # until it stands still
    assert_allclose(slowed, expected, rtol=0.02, atol=1e-3 * model.mass.sum())


def test_a_crumpled_landing_keeps_to_the_cone():
    model, state = stirred(side=10, pinned=(), upright=False)
    state = ClothState(state.positions + RAISED, state.velocities + THROWN)
    forces, _ = landings(0.2, state, model, 1)
    assert np.hypot(forces[0, 0], forces[0, 2]) < 0.3 * forces[0, 1]


@pytest.mark.parametrize(("gap", "exact"), [(5e-3, False), (5e-3, True), (5e-5, True)])
def test_what_hangs_above_a_floor_is_not_drawn_to_it(gap, exact):
    """A bead in balance on a thread, above it: free, it would fall 11 mm in the step. One solution has to do.

    Cloth that falls counts as lying on what it all but touches; near rest, it hangs there.
    """
    stiffness, mass = 1e3, 0.01
    x = np.array([[0.0, 1.0 + gap, 0.0], [0.0, gap, 0.0]])
    slack = x + np.array([[0.0, 0.0, 0.0], [0.0, mass * G / stiffness, 0.0]])
    thread = springs([[0, 1]], slack, 1.0 / stiffness)
    method = Newton(model_of((thread,), np.full(2, mass), pinned=(0,), gravity=(0.0, -G, 0.0)))
    method.limits, method.exact = Limits(contact_rounds=1), exact
    state = at_rest(x)
    after = method.advance(state, on_plane(state, (0.0, 1.0, 0.0), 0.3, h=1.0 / 30.0), 1.0 / 30.0, 1)
    assert after.time == pytest.approx(1.0 / 30.0)
    assert_allclose(after.positions, x, rtol=0, atol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_planes_never_pull(friction):
    model, rest = cloth(20, upright=False)
    ball = Sphere((0.15, -0.1, 0.15), 0.1, friction)
    state, method = ClothState(rest + 0.2 * RAISED, np.tile([0.0, -1.0, 0.0], (400, 1))), Newton(model)
    touched = rubbed = 0
    for _ in range(20):
        span = ContactSpan(state.time, state.time + FRAME, 0.05, np.full(400, 2e-3), 1.0)
        state = method.advance(state, gather_contacts([ball], state.positions, span), FRAME, 1)
        planes = method.active
        assert (planes.force >= 0.0).all()
        assert not planes.force[~planes.pushing].any()
        rub, push = planes.friction_force[planes.pushing], planes.force[planes.pushing]
        rubs = np.linalg.norm(rub, axis=1)
        assert (rubs <= friction * push * (1.0 + 1e-9)).all()  # Coulomb's cone
        assert (np.abs((rub * planes.normal[planes.pushing]).sum(axis=1)) <= 1e-9 * (1e-9 + push)).all()
        rubbed += (rubs > 0.5 * friction * push).sum() if friction > 0.0 else 0
        touched += (planes.force > 0.0).sum()
        assert np.linalg.norm(state.positions - [0.15, -0.1, 0.15], axis=1).min() > 0.1
    assert touched > 200
    assert (rubbed > 100) == (friction > 0.0)


def test_a_moving_floor_takes_cloth_along_by_friction():
    """v = μ g t until it is as fast as the floor, then with the floor."""
    model, rest = cloth(6, upright=False)
    speed, friction, h = 0.5, 0.4, FRAME
    state, method = at_rest(rest), Newton(model)
    up = np.broadcast_to([0.0, 1.0, 0.0], (1, 36, 2, 3)).copy()
    for step in range(20):
        begin, end = state.positions * [1.0, 0.0, 1.0], state.positions * [1.0, 0.0, 1.0] + [speed * h, 0.0, 0.0]
        point = np.stack([begin, end], axis=1)[None]
        contacts = Contacts(np.ones((1, 36), bool), point, up, np.zeros((1, 36, 2)), np.array([friction]))
        state = method.advance(state, contacts, h, 1)
        expected = min(speed, friction * G * h * (step + 1))
        assert_allclose(state.velocities[:, 0], expected, rtol=0, atol=0.01 * speed)
        assert_allclose(state.velocities[:, 1:], 0.0, rtol=0, atol=1e-3)


def test_an_earlier_motion_does_not_leak_into_another():
    model, state = stirred(side=6, pinned=(), upright=False)
    state = ClothState(state.positions + RAISED, state.velocities)
    contacts = on_plane(state, (0.0, 1.0, 0.0), 0.3, h=FRAME)
    fresh = Newton(model).advance(state, contacts, FRAME, 2)
    method = Newton(model)
    method.advance(ClothState(state.positions[::-1].copy(), state.velocities - [0.0, 2.0, 0.0]), contacts, FRAME, 3)
    again = method.advance(state, empty_contacts(36), FRAME, 2)
    assert_array_equal(again.positions, Newton(model).advance(state, empty_contacts(36), FRAME, 2).positions)
    again = method.advance(state, contacts, FRAME, 2)
    assert_allclose(again.positions, fresh.positions, rtol=0, atol=1e-4)  # which planes push is guessed otherwise
