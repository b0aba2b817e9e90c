"""Motion to a stated error, and rest to a stated error."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline import cloth
from vto_pipeline.cloth.dynamics import step_refinement
from vto_pipeline.cloth.dynamics.step_refinement import refine_time_step
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.rest.convergence import SettleLimits, relax_to_rest
from vto_pipeline.model.garment import RestShape

MESH = sheet(8, 8, 0.2, 0.2, upright=False)
STUFF = fabric(stretch=50.0, shear=20.0, bending=1e-5)
MODEL = build_cloth(MESH, RestShape(MESH.vertices), STUFF, pinned=(0, 7))
START = at_rest(MESH.vertices)
SECONDS = 0.1


def swinging(substeps, damping=0.0, solver=None):
    config = StepConfig(substeps=substeps, solver=solver)
    return Stepper(MODEL, [], np.full(len(MESH.vertices), 2e-3), config, damping=damping)


def rms(a, b):
    return np.sqrt(((a - b) ** 2).sum(axis=1).mean())


@pytest.fixture(scope="module")
def fine():
    return swinging(None, solver="rk4").run(START, SECONDS).positions


@pytest.mark.parametrize("error", [5e-3, 1e-3, 3e-4])
def test_error_is_about_the_true_one(error, fine):
    found = refine_time_step(swinging, START, SECONDS, error=error, finest=100000)
    assert found.error <= error
    true = rms(found.state.positions, fine)
    assert found.error / 4.0 < true < 4.0 * found.error
    steps = [row.step for row in found.trace]
    assert_allclose(np.diff(np.log2(steps)), 1.0, rtol=0, atol=1e-12)  # halved
    errors = np.array([row.error_mm for row in found.trace[1:]])
    assert (errors[1:] < 0.8 * errors[:-1]).all()
    assert found.stepper.substeps == found.trace[-1].step / (60 * SECONDS)
    assert np.isinf(found.trace[0].error_mm)


def test_it_is_no_finer_than_asked():
    asked = refine_time_step(swinging, START, SECONDS, error=1e-3, finest=100000)
    coarser = swinging(asked.stepper.substeps // 2).run(START, SECONDS)
    coarsest = swinging(asked.stepper.substeps // 4).run(START, SECONDS)
    assert rms(coarser.positions, coarsest.positions) > 1e-3


@pytest.mark.parametrize("finest", [1, 7, 8])
def test_finest_steps_are_respected(finest):
    found = refine_time_step(swinging, START, SECONDS, error=0.0, finest=finest)
    assert found.stepper.substeps == {1: 1, 7: 4, 8: 8}[finest]
    assert np.isinf(found.error) == (finest == 1)


def test_the_deadline_is_kept(monkeypatch):
    """On a clock that only steps move, by a millisecond each."""
    now, run = 0.0, Stepper.run

    def taking(stepper, state, seconds):
        nonlocal now
        before, state = stepper.steps, run(stepper, state, seconds)
        now += 1e-3 * (stepper.steps - before)
        return state

    monkeypatch.setattr(Stepper, "run", taking)
    monkeypatch.setattr(step_refinement.time, "perf_counter", lambda: now)
    found = refine_time_step(swinging, START, SECONDS, error=0.0, finest=100000, deadline=0.5)
    ends = [row.seconds for row in found.trace]
    assert ends[-1] == now <= 0.5  # not overrun: how long a run takes is foreseen from the last,
    assert now + 2.0 * (ends[-1] - ends[-2]) > 0.5  # and used: the next would not have been done
    assert len(found.trace) >= 3
    assert found.error < 5e-3
    assert_allclose(found.state.time, SECONDS, rtol=1e-9)


def test_a_deadline_that_is_over_leaves_the_start():
    found = refine_time_step(
        swinging, START, SECONDS, error=0.0, finest=100, deadline=step_refinement.time.perf_counter() - 1.0
    )
    assert found.state.time == 0.0
    assert np.isinf(found.error)


def test_simulate_says_how_well_a_motion_is_known(fine):
    asked = {"target_error_mm": 1.0, "gravity": (0.0, -9.80665, 0.0)}
    found = cloth.simulate(MESH, STUFF, pinned=[0, 7], seconds=SECONDS, settings=asked)
    assert found.report["error_mm"] <= 1.0
    assert 0.25 < 1e3 * rms(found.positions, fine) / found.report["error_mm"] < 4.0
    assert found.trace[-1].error_mm == found.report["error_mm"]
    assert_allclose(found.report["simulated_s"], SECONDS, rtol=1e-9)
    plain = cloth.simulate(MESH, STUFF, pinned=[0, 7], seconds=SECONDS)
    assert "error_mm" not in plain.report


@pytest.mark.parametrize("seconds", [0.05, 0.125, 0.13, 0.004])
@pytest.mark.parametrize("substeps", [1, 3])
def test_a_motion_ends_when_it_was_asked_to(seconds, substeps):
    """Also where that is no whole number of steps; else runs in finer steps would end at another time."""
    end = swinging(substeps).run(START, seconds)
    assert_allclose(end.time, seconds, rtol=1e-9)


def test_newton_rests_without_smaller_steps():
    """Held along a whole side there is one way to hang."""
    model = build_cloth(MESH, RestShape(MESH.vertices), STUFF, pinned=range(8))
    ends = []
    for substeps, solver in ((None, None), (40, "xpbd")):
        config = StepConfig(substeps=substeps, solver=solver)
        stepper = Stepper(model, [], np.full(64, 2e-3), config, damping=6.0)
        found = relax_to_rest(stepper, START, SettleLimits(1e-4, 0.01, 30.0, 320))
        assert found.settled
        assert stepper.has_exact_rest == (solver is None)
        assert stepper.substeps == 1 or solver
        ends.append(found.state.positions)
    assert np.abs(ends[0] - MESH.vertices).max() > 0.1
    assert rms(*ends) < 2e-4  # twice the error asked for


def test_xpbd_must_be_refined_to_rest():
    stepper = swinging(None, damping=6.0, solver="xpbd")
    first = stepper.prepare(START.positions) or stepper.substeps
    found = relax_to_rest(stepper, START, SettleLimits(1e-3, 0.0, 30.0, 10 * first))
    assert not stepper.has_exact_rest
    assert stepper.substeps > first
    assert found.settled
