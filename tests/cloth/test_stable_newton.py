"""Polishing: Newton's steps are taken as far as they lead to rest, and not where they lead away."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.cloth.dynamics.methods import FRAME
from vto_pipeline.cloth.model.build import ClothState, at_rest
from vto_pipeline.cloth.rest.convergence import SettleLimits, relax_to_rest
from vto_pipeline.cloth.rest.stable_newton import LONGEST, StableNewtonSteps


class Steps:
    """What polishing sees of a stepper."""

    has_exact_rest = can_use_exact_stiffness = True
    pushing_contacts = steps = 0
    contact_memory = None
    out_of_time = False

    def __init__(self):
        self.substeps, self.was_positive_definite, self.exact = 0.5, False, False

    @property
    def step(self):
        return FRAME / self.substeps

    def prepare(self, positions):
        pass

    def accelerate(self, on):
        pass

    def use_exact_stiffness(self, on):
        self.exact = on

    def rest_ahead(self, state, seconds):
        return None


class Straying(Steps):
    """One coordinate x [mm] with the force -x; steps as long as usual halve it, longer ones go far away.

    What it knows of contacts, it has from the last step.
    """

    def __init__(self):
        super().__init__()
        self.contact_memory = "nothing"
        self.tried = 0
        self.knew = set()

    def run(self, state, seconds):
        self.was_positive_definite = self.exact
        self.knew.add(self.contact_memory)
        strays = self.substeps < 0.5
        self.tried += strays
        self.contact_memory = "too far" if strays else "half way"
        after = state.positions + 1.0 if strays else 0.5 * state.positions
        return ClothState(after, np.zeros((1, 3)), state.time + seconds)

    def residual(self, state):
        return 0.01 * abs(1e3 * state.positions[0, 0])


def test_a_long_step_that_leads_away_is_not_taken():
    stepper = Straying()
    found = relax_to_rest(stepper, at_rest(np.array([[1e-3, 0, 0]])), SettleLimits(1e-5, 0.01, 4.0, 160))
    assert stepper.tried > 5
    assert stepper.knew == {"nothing", "half way"}
    residuals = np.array([row.residual for row in found.trace])
    assert_allclose(residuals, 0.01 * 0.5 ** np.arange(1, len(residuals) + 1), rtol=1e-9)
    assert_allclose(found.state.positions[0, 0], 1e-3 * 0.5 ** len(residuals), rtol=1e-9)
    assert not found.settled  # nobody knows whether it is stable there
    assert stepper.substeps == 0.5
    assert not stepper.exact


MOVED = 1e-4  # m: far from standing still


def test_steps_grow_while_the_force_falls():
    stepper = Steps()
    polish = StableNewtonSteps(stepper, enough=0.01)
    polish.choose(True, False, 5e-3, MOVED)
    assert stepper.exact
    stepper.was_positive_definite = True
    lengths, residual = [], 5e-3
    while not polish.took_full_step:
        assert not polish.diverged(residual, MOVED)
        polish.choose(True, False, residual, MOVED)
        lengths.append(stepper.step)
        residual *= 0.5
    assert_allclose(lengths, [4 / 30, 16 / 30, LONGEST])


@pytest.mark.parametrize("stuck", [False, True])
def test_where_cloth_is_about_to_buckle_exact_steps_are_shorter_only_if_the_usual_ones_lead_nowhere(stuck):
    stepper = Steps()
    polish = StableNewtonSteps(stepper, enough=0.01)
    polish.choose(True, stuck, 0.1, MOVED)
    assert stepper.exact
    polish.choose(False, stuck, 0.1, MOVED)
    assert stepper.exact is stuck
    assert stepper.substeps == (2.0 if stuck else 0.5)
    polish.choose(True, False, 0.1, MOVED)
    assert not stepper.exact  # the usual ones have a few looks' time first


class Restless(Steps):
    """It goes to and fro by 50 µm (rms) from look to look, and no exact step is definite."""

    usual = 0

    def __init__(self, residual):
        super().__init__()
        self.left, self.short = residual, []

    def run(self, state, seconds):
        if self.exact:
            self.short += [self.usual] * (self.substeps > 0.5)
            return state
        self.usual += 1
        return ClothState(np.full((1, 3), 3e-5 * (self.usual % 2)), np.zeros((1, 3)), state.time + seconds)

    def residual(self, state):
        return self.left


@pytest.mark.parametrize(("residual", "looks"), [(1.0, 10), (1e-3, 20)])
def test_short_exact_steps_wait_until_the_usual_ones_have_long_led_hardly_anywhere(residual, looks):
    stepper = Restless(residual)
    relax_to_rest(stepper, at_rest(np.zeros((1, 3))), SettleLimits(1e-5, 0.01, 12.0, 160))
    assert stepper.short[0] == looks


def test_what_goes_to_and_fro_is_waited_for_no_longer_than_a_vague_answer_takes():
    looks = []
    for error in (5e-3, 1e-3):
        limits = SettleLimits(error, 1.0, 12.0, 160)
        looks.append(len(relax_to_rest(Restless(2.0), at_rest(np.zeros((1, 3))), limits).trace))
    assert looks[0] <= 6 < 12 <= looks[1]


def test_who_asks_for_little_balance_but_a_near_answer_gets_it():
    limits = SettleLimits(3e-3, 1.0, 12.0, 160)
    assert len(relax_to_rest(Restless(2.0), at_rest(np.zeros((1, 3))), limits).trace) > 10


def test_what_is_left_is_told_roughly_after_three_looks_and_well_after_four():
    for error, looks in ((4e-3, 3), (2e-3, 4)):
        found = relax_to_rest(Straying(), at_rest(np.array([[1e-3, 0, 0]])), SettleLimits(error, 1.0, 4.0, 160))
        errors = np.array([row.error_mm for row in found.trace])
        assert np.flatnonzero(np.isfinite(errors))[0] == looks - 1


def test_what_leaves_more_force_is_tried_in_shorter_steps_until_they_are_as_usual():
    stepper = Steps()
    polish = StableNewtonSteps(stepper, enough=0.01)
    polish.choose(True, False, 5e-3, MOVED)
    stepper.was_positive_definite = True
    assert not polish.diverged(0.04, MOVED)  # what is soft comes first
    polish.choose(True, False, 0.04, MOVED)
    assert stepper.step == pytest.approx(1 / 30)  # no longer steps before forces are all but in balance
    polish.choose(True, False, 5e-3, MOVED)
    assert stepper.step == pytest.approx(4 / 30)
    assert polish.diverged(0.04, MOVED)  # but it has to fall
    assert stepper.exact
    assert stepper.step == pytest.approx(1 / 30)
    assert not polish.diverged(0.4, MOVED)
    polish.choose(True, False, 0.4, MOVED)
    assert stepper.exact
    assert stepper.step == pytest.approx(1 / 30)  # it is on its way: no longer steps yet
    assert not polish.diverged(5e-3, MOVED)
    polish.choose(True, False, 5e-3, MOVED)
    assert stepper.step == pytest.approx(np.sqrt(8) / 30)  # between what did and twice what did not


def test_where_cloth_all_but_stands_still_steps_grow_whatever_force_a_micrometre_of_stretch_makes():
    stepper = Steps()
    polish = StableNewtonSteps(stepper, enough=0.01)
    polish.choose(True, False, 0.1, 1e-6)
    stepper.was_positive_definite = True
    lengths = []
    for residual in (2.4, 0.02, 3.2):
        assert not polish.diverged(residual, 1e-6)
        polish.choose(True, False, residual, 1e-6)
        lengths.append(stepper.step)
    assert_allclose(lengths, [4 / 30, 16 / 30, LONGEST])
    assert polish.diverged(3.2, MOVED)  # it went somewhere
    while not polish.took_full_step:
        polish.choose(True, False, 0.1, 1e-6)
    polish.choose(True, False, 0.1, 1e-6)  # all the way, and still out of balance
    assert stepper.step < LONGEST
    for _ in range(3):
        polish.choose(True, False, 0.1, 1e-6)
    assert stepper.step == pytest.approx(1 / 30)  # so it is the force that counts
    polish.choose(True, False, 0.1, 1e-6)
    assert stepper.step == pytest.approx(4 / 30)  # for a while


def test_short_steps_that_tear_cloth_are_taken_back_and_the_usual_ones_go_on():
    stepper = Steps()
    polish = StableNewtonSteps(stepper, enough=0.01)
    assert not polish.diverged(0.17, MOVED)
    polish.choose(True, True, 0.17, MOVED)
    polish.choose(True, True, 0.17, MOVED)
    assert stepper.substeps > 0.5
    assert not polish.diverged(50.0, MOVED)  # cloth that snaps has forces above its weight for a while
    assert polish.diverged(1000.0, MOVED)
    assert stepper.substeps == 0.5
    assert not stepper.exact
    polish.choose(True, True, 0.17, MOVED)
    assert not stepper.exact  # and no other try at once
    polish.choose(True, True, 0.009, MOVED)
    assert stepper.exact  # but in balance there is nothing to be torn out of


class Buckling(Steps):
    """One coordinate x [mm] in the potential of a buckled strip, c/4 (1 - x²)²: stable at 1 and -1, not at 0.

    Each step is one of Newton's method from rest, as cloth takes them where inertia damps: with the exact stiffness
    while the system is positive definite, else with one that holds back ten times as much.
    """

    c = 0.95 * 30.0**2  # 1/s²: at 0, with the exact stiffness, a step of 1/30 s brings it twenty times as far

    def run(self, state, seconds):
        x, h = 1e3 * state.positions[0, 0], self.step
        held = 1.0 + h * h * self.c * (3.0 * x * x - 1.0)
        self.was_positive_definite = self.exact and held > 0.0
        if not self.was_positive_definite:
            held = 1.0 + 10.0 * h * h * self.c
        x += h * h * self.c * x * (1.0 - x * x) / held
        return ClothState(np.array([[1e-3 * x, 0, 0]]), np.zeros((1, 3)), state.time + seconds)

    def residual(self, state):
        x = 1e3 * state.positions[0, 0]
        return 0.1 * abs(x * (1.0 - x * x))


def test_what_falls_out_of_an_unstable_place_is_let_go():
    found = relax_to_rest(Buckling(), at_rest(np.array([[5e-6, 0, 0]])), SettleLimits(1e-5, 0.01, 4.0, 160))
    assert found.settled
    assert found.state.positions[0, 0] == pytest.approx(1e-3, abs=1e-5)
    assert len(found.trace) < 12


class Creeping(Buckling):
    """The same strip with inertia, so soft that in a step as long as usual its system is not positive definite at 0.

    The stiffness that holds back ten times as much lets it creep out of there by a tenth a step.
    """

    c = 20.0 * 30.0**2  # 1/s²

    def run(self, state, seconds):
        x, v, h = 1e3 * state.positions[0, 0], 1e3 * state.velocities[0, 0], self.step
        self.was_positive_definite = self.exact
        for _ in range(round(seconds / h)):
            self.steps += 1
            held = 1.0 + h * h * self.c * (3.0 * x * x - 1.0)
            if held <= 0.0:
                self.was_positive_definite = False
            if not self.was_positive_definite:
                held = 1.0 + 10.0 * h * h * self.c
            v = (np.exp(-5.0 * h) * v + h * self.c * x * (1.0 - x * x)) / held
            x += h * v
        return ClothState(np.array([[1e-3 * x, 0, 0]]), np.array([[1e-3 * v, 0, 0]]), state.time + seconds)


def test_where_cloth_is_about_to_buckle_steps_are_short_enough_for_it_to():
    strip = Creeping()
    found = relax_to_rest(strip, at_rest(np.array([[1e-9, 0, 0]])), SettleLimits(1e-5, 0.01, 4.5, 160))
    assert found.settled  # in 37 looks; the usual stiffness alone takes 54
    assert found.state.positions[0, 0] == pytest.approx(1e-3, abs=1e-5)
    assert strip.substeps == 0.5
    assert not strip.exact


class Balancing(Buckling):
    """The strip again: exact steps are taken where their system is definite, usual ones bring it back to the middle."""

    c = 50.0**2  # 1/s²: in the middle, systems of steps below 1/50 s are

    def run(self, state, seconds):
        x, v, h = 1e3 * state.positions[0, 0], 1e3 * state.velocities[0, 0], self.step
        self.was_positive_definite = False
        for step in range(round(seconds / h)):
            held = 1.0 + h * h * self.c * (3.0 * x * x - 1.0)
            if self.exact and held <= 0.0:
                return ClothState(*(np.array([[1e-3 * one, 0, 0]]) for one in (x, v)), state.time + step * h)
            v = (v + h * self.c * x * (1.0 - x * x)) / held if self.exact else -0.5 * x / h
            x += h * v
        self.was_positive_definite = self.exact
        return ClothState(*(np.array([[1e-3 * one, 0, 0]]) for one in (x, v)), state.time + seconds)


def test_the_nearer_a_step_is_to_the_longest_the_sooner_cloth_leaves_a_saddle():
    found = relax_to_rest(Balancing(), at_rest(np.array([[1e-9, 0, 0]])), SettleLimits(1e-5, 0.01, 10.0, 160))
    assert found.settled
    assert found.state.positions[0, 0] == pytest.approx(1e-3, abs=1e-5)
    assert len(found.trace) < 20


class Chattering(Straying):
    """The same, but what a longer step makes of its contacts is not positive definite."""

    def run(self, state, seconds):
        found = super().run(state, seconds)
        self.was_positive_definite = self.exact and self.substeps >= 0.5
        return ClothState(0.5 * state.positions, found.velocities, found.time)


def test_what_stands_in_steps_that_hold_nothing_back_is_at_rest():
    stepper = Chattering()
    found = relax_to_rest(stepper, at_rest(np.array([[1e-3, 0, 0]])), SettleLimits(1e-5, 0.01, 12.0, 160))
    assert found.settled
    assert found.error <= 1e-5
    assert found.state.time > 16 * 4 / 30  # so long, in steps that are definite


def test_what_drifts_on_does_not_stand():
    class Drifting(Chattering):
        def run(self, state, seconds):
            return ClothState(state.positions + 2e-7, super().run(state, seconds).velocities, state.time + seconds)

        def residual(self, state):
            return 1e-3

    found = relax_to_rest(Drifting(), at_rest(np.zeros((1, 3))), SettleLimits(1e-5, 0.01, 30.0, 160))
    assert not found.settled  # a tenth of the bound is left behind every few looks


def test_what_was_indefinite_elsewhere_says_nothing_here():
    class Moving(Steps):
        """It stands at 0, where long steps are indefinite, and after a second at 0.1 mm, where they stray."""

        place = 0.0

        def run(self, state, seconds):
            self.place = 1e-4 if state.time > 1.0 else 0.0
            strays = self.place > 0.0 and self.substeps < 0.5
            self.was_positive_definite = self.exact and (self.place > 0.0 or self.substeps >= 0.5)
            return ClothState(np.full((1, 3), self.place + strays), np.zeros((1, 3)), state.time + seconds)

        def residual(self, state):
            return 1e-3 + abs(state.positions[0, 0] - self.place)

    found = relax_to_rest(Moving(), at_rest(np.zeros((1, 3))), SettleLimits(1e-5, 0.01, 8.0, 160))
    assert not found.settled


class Slowly(Creeping):
    """A strip that leaves the middle by itself, e times as far in 0.13 s; in steps of 0.13 s it is not definite."""

    c = 100.0  # 1/s²


@pytest.mark.parametrize("off", [1e-9, 1e-8, 1e-7])
def test_a_place_that_is_left_within_seconds_is_no_rest(off):
    found = relax_to_rest(Slowly(), at_rest(np.array([[off, 0, 0]])), SettleLimits(1e-5, 0.01, 12.0, 160))
    assert found.settled
    assert found.state.positions[0, 0] == pytest.approx(1e-3, abs=1e-5)


def test_what_only_creeps_with_the_usual_stiffness_has_not_stood():
    class Held(Steps):
        def run(self, state, seconds):
            return ClothState(state.positions + 1e-9, np.zeros((1, 3)), state.time + seconds)

        def residual(self, state):
            return 1e-3

    found = relax_to_rest(Held(), at_rest(np.zeros((1, 3))), SettleLimits(1e-5, 0.01, 6.0, 160))
    assert not found.settled  # no step was with the exact stiffness: it may be about to buckle


class Indefinite(Steps):
    """Cloth that buckles within an edge: with the exact stiffness no step is short enough."""

    def choices(self, count):
        """Steps per frame and whether they are exact, in so many looks, the cloth all but still."""
        chooser, chosen = StableNewtonSteps(self, 0.01), []
        for _ in range(count):
            chooser.choose(near=True, stuck=True, residual=1.0, moved=MOVED)
            chosen.append((self.substeps, self.exact))
        return chosen


def test_where_no_step_is_short_enough_time_goes_on_with_the_usual_stiffness():
    chosen = Indefinite().choices(200)
    usual = [steps == 0.5 and not exact for steps, exact in chosen]
    shortest = [exact and steps == 32.0 for steps, exact in chosen]
    assert any(shortest)  # it was tried
    assert np.mean(usual) > 0.8
    runs = np.diff(np.flatnonzero(shortest))
    assert runs.min() > 4  # never one after another, in which time would stand still
    assert (np.diff(runs) > 0).all()  # and tried more and more seldom
