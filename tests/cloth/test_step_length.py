"""Steps as long as the motion allows, beside closed forms and beside steps of a frame."""

from math import exp

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline import cloth
from vto_pipeline.bench.cloth.scenes import hang
from vto_pipeline.cloth.collision.shapes.colliders import Plane
from vto_pipeline.cloth.collision.shapes.moving import Moving, Path
from vto_pipeline.cloth.dynamics.step_length import run_at_own_pace
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import ClothState, at_rest, build_cloth
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

FRAME = 1.0 / 60.0
LOSS = 0.5 * FRAME * GRAVITY  # m lost in a second by cloth that falls freely in steps of a frame


def stepper(mesh, *, colliders=(), damping=0.0, pinned=(), **settings):
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(), pinned=pinned)
    return Stepper(model, colliders, np.full(len(mesh.vertices), 1e-3), StepConfig(**settings), damping=damping)


@pytest.mark.parametrize("damping", [2.0, 10.0])
def test_what_falls_at_its_last_speed_loses_no_more(damping):
    """It speeds up no longer, but damping still takes what gravity gives, and errs in it as much."""
    mesh = sheet(4, 4, 0.1, 0.1)
    ended = run_at_own_pace(stepper(mesh, damping=damping), at_rest(mesh.vertices), 2.0)
    fallen = GRAVITY / damping * (2.0 - (1.0 - exp(-2.0 * damping)) / damping)  # v' = g - c v
    assert_allclose(ended.time, 2.0, rtol=1e-9)
    assert (
        np.abs((mesh.vertices - ended.positions)[:, 1] - fallen).max() < 1.05 * 2.0 * LOSS
    )  # which is 1 + c h / 3 times as much


def test_what_falls_freely_takes_even_steps():
    mesh = sheet(4, 4, 0.1, 0.1)
    ours = stepper(mesh)
    ended = run_at_own_pace(ours, at_rest(mesh.vertices), 0.5)
    assert ours.steps == 30
    assert_allclose((mesh.vertices - ended.positions)[:, 1], GRAVITY * FRAME**2 * 30 * 31 / 2, rtol=1e-9)


def test_a_small_piece_that_falls_beside_a_large_one_that_hangs_takes_even_steps():
    aside = np.array([1.0, 0.0, 0.0])
    large, small = sheet(12, 12, 0.1, 0.1), sheet(2, 2, 0.01, 0.01)
    both = TriangleMesh(
        np.vstack([large.vertices, small.vertices + aside]), np.vstack([large.faces, small.faces + 144])
    )
    ours = stepper(both, pinned=range(12), self_collision=False)
    ended = run_at_own_pace(ours, at_rest(both.vertices), 0.5)
    assert_allclose((both.vertices - ended.positions)[144:, 1], GRAVITY * FRAME**2 * 30 * 31 / 2, rtol=1e-8)


def test_a_step_in_which_cloth_meets_a_wall_is_taken_back(monkeypatch):
    """It glides over a floor without friction: nothing speeds it up, until the wall stops it within one long step."""
    mesh = sheet(4, 4, 0.1, 0.1, upright=False)
    mesh = TriangleMesh(mesh.vertices * [1.0, 0.0, 1.0] + [0.0, 1e-3, 0.0], mesh.faces)
    reach = 0.35 + float(mesh.vertices[:, 0].max())
    floor, wall = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.0), Plane((reach, 0.0, 0.0), (-1.0, 0.0, 0.0), 0.0)
    ours = stepper(mesh, colliders=[floor, wall])
    began, run = [], ours.run
    monkeypatch.setattr(ours, "run", lambda state, seconds: began.append((state.time, seconds)) or run(state, seconds))
    ended = run_at_own_pace(ours, ClothState(mesh.vertices, np.tile([1.0, 0.0, 0.0], (16, 1)), 0.0), 0.5)
    times, lengths = np.array(began).T
    first = np.flatnonzero(np.diff(times) == 0.0)[0]
    assert times[first] < 0.35 < times[first] + lengths[first]
    assert_allclose(lengths[first : first + 2], [4.0 * FRAME, FRAME])
    assert ended.positions[:, 0].max() < reach


def test_a_sheet_that_hangs_is_as_near_the_truth_in_a_third_of_the_steps():
    scene = hang(16)

    def ended(**settings):
        skin = np.full(len(scene.start), scene.skin)
        ours = Stepper(scene.model, (), skin, StepConfig(self_collision=False, **settings), damping=scene.damping)
        return run_at_own_pace(ours, at_rest(scene.start), 2.0).positions, ours.steps

    own, steps = ended()
    true, _ = ended(substeps=16)
    assert steps < 40  # of 120
    assert np.sqrt(((own - true) ** 2).sum(axis=1).mean()) < 0.5 * LOSS


@pytest.mark.parametrize("case", ["nothing", "steps asked for", "xpbd", "pins on a path", "a wall that moves"])
def test_what_lies_still_has_even_steps_where_something_else_says_what_happens(case):
    mesh = sheet(4, 4, 0.1, 0.1, upright=False)
    floor = Plane((0.0, float(mesh.vertices[0, 1]) - 1e-3, 0.0), (0.0, 1.0, 0.0))
    settings = {"steps asked for": {"substeps": 1.0}, "xpbd": {"solver": "xpbd"}}.get(case, {})
    more = {"colliders": [floor]}
    if case == "pins on a path":
        more |= {"pinned": [0, 3], "pin_path": lambda t: mesh.vertices[[0, 3]] + np.array([0.01 * t, 0.0, 0.0])}
    if case == "a wall that moves":
        more["colliders"].append(Moving(Plane((-9.0, 0.0, 0.0), (1.0, 0.0, 0.0)), Path([0.0, 9.0], np.zeros((2, 3)))))
    found = cloth.simulate(mesh, fabric(), seconds=0.5, settings={"skin_mm": 1.0, **settings}, **more)
    assert (found.report["steps"] < 30) == (case == "nothing")
