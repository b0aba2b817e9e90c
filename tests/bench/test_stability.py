"""The stability bench: its verdicts on methods that are known to hold, to break, and to cheat."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.bench.bench import Watch
from vto_pipeline.bench.cloth.closed_forms import growth_and_frequency
from vto_pipeline.bench.stability.frequency import highest_mode
from vto_pipeline.bench.stability.limits import LIMIT, measured_growth, predicted_break
from vto_pipeline.bench.stability.refused import REFUSED, refuse
from vto_pipeline.bench.stability.sheets import quiet_sheet, sheet_cases
from vto_pipeline.bench.stability.strands import strand_cases
from vto_pipeline.bench.stability.table import measured_limit, rows
from vto_pipeline.bench.stability.trial import VERDICTS, run_trial
from vto_pipeline.cloth.constraints.points.spring import springs
from vto_pipeline.cloth.dynamics.methods import METHODS
from vto_pipeline.cloth.model.build import ClothState, model_of

CASES = {case.name: case for case in (*strand_cases(), *sheet_cases())}
PATIENCE = 60.0  # s; nothing here takes a second when compiled


def verdict(name, method, **changes):
    found = run_trial(replace(CASES[name], **changes), METHODS[method], PATIENCE)[1]
    assert found["verdict"] in VERDICTS
    return found


@pytest.mark.parametrize(
    "name", ["stiffness 1e12", "h 1/10", "h 1/60", "km taken as m", "all pinned", "zero-area triangles"]
)
def test_large_implicit_steps_hold(name):
    found = verdict(name, "newton")
    assert found["verdict"] == "passes"
    assert found["energy_gain"] <= 0.05


@pytest.mark.parametrize("name", ["collapsed to a line", "inverted triangles"])
def test_a_distorted_sheet_recovers(name):
    found = verdict(name, "newton", sweeps=1)
    assert found["verdict"] == "passes"
    assert found["distance_share"] <= 0.01
    assert 5 < found["recovery_frames"] < 300  # it takes time, and starts far from rest


def test_an_explicit_method_holds_under_its_limit_and_breaks_beyond():
    fine, coarse = (verdict(name, "symplectic_euler") for name in ("h 1/2000", "h 1/60"))
    assert fine["step_times_frequency"] < 2.0 < coarse["step_times_frequency"]
    assert fine["verdict"] == "passes"
    assert coarse["verdict"] == "diverges"
    assert not coarse["finite"]


def test_integrators_of_forces_do_not_take_what_is_rigid():
    assert verdict("rigid strand", "verlet")["verdict"] == "does not apply"


def test_out_of_patience():
    assert run_trial(CASES["h 1/60"], METHODS["xpbd"], 0.0)[1]["verdict"] == "too slow"


class Cheat:
    """A method that does something wrong."""

    def __init__(self, model, **settings):
        pass


class Frozen(Cheat):
    def advance(self, state, contacts, h, substeps):
        return state


class Thrown(Cheat):
    def advance(self, state, contacts, h, substeps):
        return ClothState(state.positions + 10.0 * h * substeps, state.velocities + 10.0, state.time)


class Lost(Cheat):
    def advance(self, state, contacts, h, substeps):
        return ClothState(np.full_like(state.positions, np.nan), state.velocities, state.time)


class Broken(Cheat):
    def advance(self, state, contacts, h, substeps):
        raise np.linalg.LinAlgError("singular")


class Stretched(Cheat):
    def advance(self, state, contacts, h, substeps):
        return ClothState(1.5 * state.positions - [0.0, 1.0, 0.0], state.velocities, state.time)


@pytest.mark.parametrize(
    ("method", "said"),
    [
        (Frozen, "does not move"),
        (Thrown, "gains energy"),
        (Lost, "diverges"),
        (Broken, "crashes"),
        (Stretched, "overstressed"),
    ],
)
def test_a_cheat_is_found_out(method, said):
    case = replace(CASES["h 1/60"], frames=3 if method is Stretched else 60)
    assert run_trial(case, method, PATIENCE)[1]["verdict"] == said


def test_not_recovering_is_found_out():
    found = run_trial(replace(CASES["collapsed to a line"], frames=3), Frozen, PATIENCE)[1]
    assert found["verdict"] == "does not recover"
    assert found["recovery_frames"] is None


def test_distance_does_not_see_rigid_motion_and_sees_the_rest():
    case = CASES["collapsed to a line"]
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    assert_allclose(case.distance(case.rest @ turn + [3.0, -2.0, 1.0]), 0.0, atol=1e-12)  # rounding
    size = np.sqrt((case.rest**2).sum(axis=1).mean())
    assert_allclose(case.distance(1.1 * case.rest), 0.1 * size, rtol=1e-9)
    ball = CASES["flattened ball"]
    assert ball.distance(-ball.rest) > 0.1 * ball.size  # turned inside out is not the same shape


def test_the_highest_frequency_of_a_chain():
    """N masses on N springs, one end held: ω = 2 √(k/m) sin((2N - 1) π / (4N + 2))."""
    count, stiffness, mass = 7, 300.0, 0.2
    points = np.outer(np.arange(count + 1), [0.1, 0.0, 0.0])
    pairs = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    model = model_of((springs(pairs, points, 1.0 / stiffness),), np.full(count + 1, mass), pinned=[0])
    found, mode = highest_mode(model, points)
    closed = 2.0 * np.sqrt(stiffness / mass) * np.sin((2 * count - 1) * np.pi / (4 * count + 2))
    assert_allclose(found, closed, rtol=1e-12)  # dense eigenvalues, to rounding
    assert_allclose(mode[:, 1:], 0.0, atol=1e-12)


@pytest.mark.parametrize("method", ["symplectic_euler", "verlet", "leapfrog", "rk4", "predictor_corrector"])
def test_the_step_at_which_an_explicit_method_breaks(method):
    closed = {"rk4": 2.0 * np.sqrt(2.0), "predictor_corrector": 1.2872}.get(method, 2.0)
    found = measured_limit(method, quiet_sheet())[1]
    assert found["verdict"] == "limited"
    assert_allclose(found["limit"], closed, rtol=1e-4)  # four digits are given
    assert closed * 0.999 < found["breaks_at"] < closed * 1.01  # growth of a thousandfold takes a little more
    assert 0.0 < found["breaks_at"] - found["holds_at"] < 3e-4  # bracketed


@pytest.mark.parametrize(("method", "closed"), [("explicit_euler", np.sqrt(1.25)), ("rk2", np.sqrt(1.0 + 0.5**4 / 4))])
def test_methods_that_grow_at_any_step(method, closed):
    case = quiet_sheet()
    assert_allclose(
        measured_growth(case, METHODS[method], 0.5), closed, rtol=1e-6
    )  # amplitude 1e-3 of an edge: nearly linear
    assert_allclose(growth_and_frequency(method, 0.5)[0], closed, rtol=1e-12)
    assert LIMIT[method] == 0.0
    assert measured_limit(method, case)[1]["verdict"] == "always grows"


def test_theory_agrees_with_itself_at_the_limit():
    for method, limit in LIMIT.items():
        if limit:
            assert growth_and_frequency(method, 0.999 * limit)[0] <= 1.0 + 1e-12
            assert growth_and_frequency(method, 1.001 * limit)[0] > 1.0 + 1e-4
            assert predicted_break(method) >= limit


@pytest.mark.parametrize("solver", [None, "xpbd", "verlet"])
@pytest.mark.parametrize("what", REFUSED)
def test_bad_input_is_refused_by_name(what, solver):
    found = refuse(what, solver)[1]
    assert found["verdict"] == "refused"
    assert found["why"]


def test_rows_of_the_default_come_first():
    first = next(iter(rows(True, Watch())))
    assert first.method == "default"
    assert first.settings["chosen"] == "newton"
    assert first.errors["verdict"] == "passes"
