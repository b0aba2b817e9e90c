"""A deadline is kept to within a step, on a clock that only steps and the compiler move."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline.cloth import drape as drape_file
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.rest.convergence import SettleLimits, relax_to_rest
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job

MESH = sheet(6, 6, 0.3, 0.3, upright=False)
TAKES = 2.0  # s, each step
LOADING = 100.0  # s


@pytest.fixture
def clock(monkeypatch):
    """The time now, in a list; each step of any cloth takes TAKES."""
    now, advance = [1000.0], Stepper._advance_span

    def taking(stepper, state, h, count):
        now[0] += TAKES * count
        return advance(stepper, state, h, count)

    monkeypatch.setattr(Stepper, "_advance_span", taking)
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    return now


def hanging() -> Stepper:
    model = build_cloth(MESH, RestShape(MESH.vertices), fabric(), pinned=[0, 5])
    stepper = Stepper(model, [], np.full(36, 1e-3), StepConfig(solver="newton", substeps=1), damping=5.0)
    stepper.prepare(MESH.vertices)
    return stepper


@pytest.mark.parametrize(("left", "steps"), [(-1.0, 0), (1.0, 1), (5.0, 2), (6.5, 3), (1e9, 10)])
def test_no_step_begins_that_would_not_be_done(clock, left, steps):
    """How long the first one takes nobody knows: it is begun where any time is left."""
    stepper = hanging()
    stepper.deadline = clock[0] + left
    after = stepper.run(at_rest(MESH.vertices), 10.0 * stepper.step)
    assert stepper.steps == steps
    assert_allclose(after.time, steps * stepper.step, rtol=1e-12, atol=0.0)
    assert clock[0] == 1000.0 + TAKES * steps


def test_a_look_that_is_cut_short_is_kept_and_tells_no_error(clock):
    """Against the same steps without a deadline, which end at the same bits."""
    stepper, limits = hanging(), SettleLimits(1e-5, 0.01, 60.0, 320)
    looks = 3.5  # of 6 steps
    began = clock[0]
    found = relax_to_rest(stepper, at_rest(MESH.vertices), replace(limits, deadline=began + looks * 6 * TAKES))
    assert clock[0] == began + looks * 6 * TAKES  # all of it is used
    assert len(found.trace) == 4
    assert not found.settled
    assert found.trace[-1].error_mm == found.trace[-2].error_mm
    assert stepper.deadline == np.inf
    free = hanging()
    free.accelerate(True)
    assert np.array_equal(free.run(at_rest(MESH.vertices), looks * 6 * free.step).positions, found.state.positions)
    assert len(relax_to_rest(hanging(), at_rest(MESH.vertices), limits).trace) > 4


def test_loading_the_kernels_counts_for_the_budget(clock, monkeypatch):
    """But not for how fast the drape is."""

    def loading() -> float:
        clock[0] += LOADING
        return LOADING

    monkeypatch.setattr(drape_file, "warm_up", loading)
    ball = sheet(8, 8, 0.6, 0.6, upright=False)
    settings = {"place": "as_it_stands", "settle_seconds": 0.5}
    over = type(ball)(ball.vertices * [0.5, 1.0, 0.5] + [0.0, 0.02, 0.0], ball.faces)
    steps = {}
    for budget in (LOADING - 1.0, LOADING + 5.0 * TAKES):
        job = Job()
        drape(over, ball, fabric(bending=1e-5), {**settings, "time_budget_s": budget}, job)
        steps[budget] = job.metrics["steps"]
        assert job.metrics["seconds"] == TAKES * job.metrics["steps"]
    assert list(steps.values()) == [0, 5]
