"""What the exact stiffness tells of cloth that hardly moves: a clamped strip pressed to about Euler's load."""

from types import SimpleNamespace

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.implicit_step.rest_ahead import RestAhead
from vto_pipeline.cloth.model.build import at_rest, build_cloth, without_gravity
from vto_pipeline.cloth.rest.convergence import SettleLimits, relax_to_rest
from vto_pipeline.cloth.rest.foresight import VAGUE, Foresight
from vto_pipeline.model.garment import RestShape

LENGTH, STRETCH, BENDING = 0.3, 1000.0, 1e-3
CRITICAL = 4.0 * np.pi**2 * BENDING / LENGTH**2 / STRETCH
"""Strain at which a strip clamped at both ends buckles (Euler)."""


def pressed(load):
    """A strip pressed to that share of the critical strain, a micrometre bent; its places, and how it is bent [m]."""
    mesh = sheet(33, 5, LENGTH + 0.02, 0.04, upright=False)
    column = np.arange(len(mesh.vertices)) % 33
    clamped = np.flatnonzero((column < 2) | (column > 30))
    cloth = build_cloth(mesh, RestShape(mesh.vertices), fabric(stretch=STRETCH, bending=BENDING), pinned=clamped)
    points = mesh.vertices.copy()
    along = np.clip((points[:, 0] - 0.01) / LENGTH, 0.0, 1.0)
    bent = 0.5e-6 * (1.0 - np.cos(2.0 * np.pi * along))
    points[:, 0] *= 1.0 - load * CRITICAL
    points[:, 1] += bent
    stepper = Stepper(without_gravity(cloth), [], np.full(len(points), 1e-3), StepConfig(), damping=5.0)
    stepper.prepare(points)
    return stepper, points, bent


@pytest.mark.parametrize("load", [0.0, 0.5, 0.97])
def test_below_its_critical_load_a_strip_is_stable_and_straightens(load):
    stepper, points, bent = pressed(load)
    ahead = stepper.rest_ahead(at_rest(points), 1.0)
    assert not ahead.unstable.any()
    assert_allclose(ahead.move[:, 1], -bent, rtol=0, atol=0.15e-6)


@pytest.mark.parametrize("load", [1.03, 1.2])
def test_above_it_what_is_bent_is_about_to_buckle(load):
    stepper, points, bent = pressed(load)
    ahead = stepper.rest_ahead(at_rest(points), 1.0)
    assert ahead.unstable[bent > 0.2e-6].all()
    assert not ahead.unstable[bent == 0.0].any()


def test_far_above_it_nothing_is_known():
    stepper, points, _ = pressed(3.0)
    assert stepper.rest_ahead(at_rest(points), 1.0) is None
    assert Foresight(stepper).error(at_rest(points), 1e-6, ends=True) == VAGUE


def test_only_what_is_stable_is_called_at_rest():
    stepper, points, _ = pressed(0.97)
    stays = relax_to_rest(stepper, at_rest(points), SettleLimits(1e-4, 0.01, 100.0, 320))
    assert stays.settled
    assert np.ptp(stays.state.positions[:, 1]) < 2e-6
    stepper, points, _ = pressed(1.1)
    buckles = relax_to_rest(stepper, at_rest(points), SettleLimits(1e-4, 0.01, 100.0, 320))
    assert buckles.settled
    inextensible = 2.0 / np.pi * LENGTH * np.sqrt(0.1 * CRITICAL)  # of the arc that takes up what is too long
    assert_allclose(np.ptp(buckles.state.positions[:, 1]), inextensible, rtol=0.08)
    assert min(row.error_mm for row in buckles.trace[:10]) > 0.5  # while it is all but flat


class Answering:
    """A stepper that foresees the same for ever."""

    def __init__(self, ahead):
        self.ahead, self.asked = ahead, 0

    def rest_ahead(self, state, seconds):
        self.asked += 1
        return self.ahead


def foreseen(move, unstable, to_come=0.0, ends=True):
    moves = np.zeros((100, 3))
    moves[:, 0] = move
    found = Foresight(Answering(RestAhead(moves, np.arange(100) < unstable)))
    return found.error(SimpleNamespace(), to_come, ends=ends)


def test_no_less_is_told_than_is_foreseen_or_than_moves_tell():
    assert foreseen(1e-4, 0) == pytest.approx(3e-4)
    assert foreseen(1e-4, 0, to_come=4e-4) == 4e-4
    assert foreseen(0.0, 1) == pytest.approx(0.1 * VAGUE)  # a hundredth of the vertices may buckle
    assert foreseen(1e-4, 1) == pytest.approx(np.sqrt(2.0) * 3e-4)
    assert foreseen(1.0, 0) == VAGUE
    assert foreseen(0.0, 0, to_come=5e-3) == 5e-3


def test_it_is_asked_now_and_then_and_wherever_cloth_may_be_at_rest():
    stepper = Answering(RestAhead(np.zeros((4, 3)), np.zeros(4, bool)))
    foresight = Foresight(stepper)
    for _ in range(15):
        foresight.error(SimpleNamespace(), 1e-3, ends=False)
    assert stepper.asked == 3
    foresight.error(SimpleNamespace(), 1e-3, ends=True)
    assert stepper.asked == 4
    foresight.error(SimpleNamespace(), 1e-2, ends=True)  # its moves tell enough
    assert stepper.asked == 4
