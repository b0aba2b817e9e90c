"""Which method is taken, and with what steps."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import eigh

from vto_pipeline.cloth.collision.contacts import ContactSpan, gather_contacts
from vto_pipeline.cloth.collision.shapes.colliders import Sphere
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.dynamics.methods import FRAME, METHODS, choose_method, highest_frequency
from vto_pipeline.cloth.implicit_step.stiffness import Stiffness
from vto_pipeline.cloth.model.build import ClothState, build_cloth, model_of
from vto_pipeline.cloth.model.materials import Materials
from vto_pipeline.cloth.simulation import simulate
from vto_pipeline.errors import ConfigError, DivergedError
from vto_pipeline.model.garment import RestShape
from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.linear.block_matrix import to_scipy

EXPLICIT = ["explicit_euler", "symplectic_euler", "verlet", "leapfrog", "rk2", "rk4", "predictor_corrector"]
ROD = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]])


def cloth(side=8, stretch=300.0, pinned=(0,), materials=None):
    mesh = sheet(side, side, 0.05 * (side - 1), 0.05 * (side - 1))
    stuff = fabric(stretch=stretch, shear=0.3 * stretch, poisson=0.2, bending=1e-4)
    return build_cloth(mesh, RestShape(mesh.vertices), stuff, pinned=pinned, materials=materials), mesh.vertices


def rods(compliance, mass=0.01):
    return model_of((springs([[0, 1], [1, 2]], ROD, compliance),), np.full(3, mass), pinned=(0,))


def exact_frequency(model, x):
    free = np.repeat(model.inverse_mass > 0.0, 3)
    stiffness = to_scipy(Stiffness(model).assemble(x)).toarray()[np.ix_(free, free)]
    return np.sqrt(eigh(stiffness, np.diag(np.repeat(model.mass, 3)[free]), eigvals_only=True)[-1])


def test_cloth_is_moved_by_newton_unless_somebody_says_otherwise():
    model, x = cloth()
    choice = choose_method(model, x, None, None, None)
    assert (choice.method, choice.substeps, choice.sweeps) == ("newton", 1, 1)
    assert "64 vertices" in choice.reason
    steps = int(choice.reason.split("explicit method ")[1].split()[0])
    assert 1.0 <= steps / (FRAME * exact_frequency(model, x) / 0.8) < 3.0


def test_what_is_rigid_is_held_by_multipliers():
    choice = choose_method(rods(0.0), ROD, None, None, None)
    assert choice.method == "xpbd"
    assert "rigid" in choice.reason
    assert choose_method(rods(1e-9), ROD, None, None, None).method == "newton"


@pytest.mark.parametrize("name", METHODS)
def test_what_was_asked_for_is_taken(name):
    model, x = cloth()
    choice = choose_method(model, x, name, 7, 5)
    assert (choice.method, choice.substeps, choice.sweeps) == (name, 7, 5)
    assert choice.reason == "chosen by the user"
    usual = choose_method(model, x, name, None, None)
    assert usual.substeps >= 1
    assert usual.sweeps >= 1


def test_no_such_method():
    model, x = cloth()
    with pytest.raises(ConfigError, match="magic.*allowed: newton, xpbd"):
        choose_method(model, x, "magic", None, None)


@pytest.mark.parametrize("name", EXPLICIT)
def test_explicit_methods_ask_for_what_is_rigid_no_number_of_steps(name):
    """They refuse it when they run, in words; the choice must not fail before, in numbers."""
    choice = choose_method(rods(0.0), ROD, name, None, None)
    assert choice.substeps >= 1
    method = METHODS[name](rods(0.0))
    with pytest.raises(ConfigError, match="rigid"):
        method.advance(
            ClothState(ROD, np.zeros((3, 3))), gather_contacts([], ROD, ContactSpan(0, 1, 1, np.zeros(3), 1)), 1e-3, 1
        )


@pytest.mark.parametrize("stretch", [1.0, 300.0, 3e4])
@pytest.mark.parametrize("membrane", ["threads", "green", "springs"])
def test_highest_frequency_is_bounded_from_above_and_not_by_much(stretch, membrane):
    materials = Materials(membrane=membrane, bending="none" if membrane == "springs" else "hinge")
    for amount in (0.0, 2e-3):
        model, rest = cloth(stretch=stretch, materials=materials)
        x = rest + np.random.default_rng(0).normal(0.0, amount, rest.shape)
        assert 1.0 <= highest_frequency(model, x) / exact_frequency(model, x) < 3.0


def test_highest_frequency_of_a_spring_is_the_textbooks():
    one = model_of((springs([[0, 1]], ROD[:2], 1e-3),), np.array([1.0, 0.25]), pinned=(0,))
    assert_allclose(highest_frequency(one, ROD[:2]), np.sqrt(1e3 / 0.25), rtol=1e-12)


def test_highest_frequency_at_its_ends():
    assert highest_frequency(rods(0.0), ROD) == np.inf
    assert highest_frequency(model_of((), np.ones(3)), np.zeros((3, 3))) == 0.0
    assert choose_method(model_of((), np.ones(3)), np.zeros((3, 3)), "rk4", None, None).substeps == 1


@pytest.mark.parametrize("name", EXPLICIT)
def test_steps_of_explicit_methods_are_stable(name):
    """Beyond its limit a method grows by powers of ten."""
    model, x = cloth(6, 300.0, pinned=(0, 5))
    choice = choose_method(model, x, name, None, None)
    v = np.random.default_rng(1).normal(0.0, 0.05, x.shape)
    v[[0, 5]] = 0.0
    state = ClothState(x, v)
    if name == "explicit_euler":
        model, _ = cloth(6, 300.0, pinned=(0, 5), materials=Materials(rayleigh=1e-3))  # undamped, no step is stable
    contacts = gather_contacts([], x, ContactSpan(0.0, 1.0, 1.0, np.zeros(36), 1.0))
    after = METHODS[name](model).advance(state, contacts, FRAME / choice.substeps, 10 * choice.substeps)
    assert np.abs(after.velocities).max() < 5.0
    assert np.abs(after.positions - x).max() > 1e-3


def test_there_is_an_end_to_the_steps():
    assert choose_method(rods(1e-12), ROD, "rk4", None, None).substeps == 10000


SLOW = {"projective": 1, "vertex_descent": 2}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name == "fast_projection" else name for name in METHODS],
)
def test_the_same_bits_with_one_thread_and_two(name):
    """Over the size from which threads share the work, onto a ball."""
    mesh = sheet(52, 52, 0.5, 0.5, upright=False)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(stretch=100.0, shear=30.0, bending=1e-5), pinned=(0, 51))
    ball = Sphere((0.25, -0.102, 0.25), 0.1, 0.4)
    h, count = 1.0 / 2000.0, len(mesh.vertices)
    start = ClothState(mesh.vertices, np.tile([0.1, -2.0, 0.0], (count, 1)))
    start.velocities[[0, 51]] = 0.0
    ends = []
    for threads in (1, 2):
        with limited_threads(threads):
            method, state = METHODS[name](model, sweeps=SLOW.get(name, 2)), start
            for _ in range(2):
                span = ContactSpan(state.time, state.time + 2 * h, 0.02, np.full(count, 2e-3), 0.5)
                state = method.advance(state, gather_contacts([ball], state.positions, span), h, 2)
            ends.append(state)
    assert_array_equal(ends[0].positions, ends[1].positions)
    assert_array_equal(ends[0].velocities, ends[1].velocities)
    assert np.isfinite(ends[0].positions).all()
    away = np.linalg.norm(ends[0].positions - ball.center, axis=1)
    assert 0.1 < away.min() < 0.103  # it has arrived


@pytest.mark.parametrize("method", ["explicit_euler", "predictor_corrector", "rk4"])
def test_a_cloth_that_leaves_all_bounds_among_colliders_is_reported(method):
    mesh = sheet(6, 6, 0.3, 0.3, upright=False)
    with pytest.raises(DivergedError, match="not finite"):
        simulate(
            mesh,
            fabric(stretch=1e6, shear=1e6),
            colliders=[Sphere((0.1, -0.1, 0.1), 0.08)],
            seconds=30.0,
            settings={"solver": method, "substeps": 1},
        )
