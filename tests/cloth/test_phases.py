"""Rest and clearing: what is moved off the body after it came to rest has not come to rest."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from cloth_scenes import ball, fabric, moved, sheet

import vto_pipeline.cloth.placement.collision_free_start as start_module
import vto_pipeline.cloth.rest.phases as module
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.placement.collision_free_start import Start
from vto_pipeline.cloth.placement.thinning import BodyGrowth, Thinning
from vto_pipeline.cloth.rest.convergence import SettlingResult
from vto_pipeline.cloth.rest.phases import Phases
from vto_pipeline.errors import IntersectingError
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

NONE, ONE = np.zeros((0, 2), np.int32), np.zeros((1, 2), np.int32)


class Ready:
    """A cloth among its colliders, of which only the length of its steps is asked."""

    has_exact_rest, substeps = True, 1.0

    def prepare(self, positions):
        pass


def ended(monkeypatch, clearings):
    """How a cloth ends that settles at once, each time; the clearing moves it, or not, and leaves pairs, in turn."""
    mesh = sheet(4, 4, 0.1, 0.1)
    model, rest = build_cloth(mesh, RestShape(mesh.vertices), fabric()), RestShape(mesh.vertices)
    left = list(clearings)

    def clear(stepper, state, *given):
        moves, pairs = left.pop(0)
        return (replace(state, positions=state.positions + 0.001) if moves else state), pairs

    monkeypatch.setattr(module, "relax_to_rest", lambda stepper, state, *given: SettlingResult(state, True, 1e-4, 1e-3))
    monkeypatch.setattr(module, "clear_body_crossings", clear)
    found = Phases(model, rest, fabric(), DrapeConfig(), Job()).settle_and_clear(
        at_rest(mesh.vertices), Ready(), ball(0.3, levels=1), np.inf
    )
    assert not left
    return found


def test_what_lies_clear_is_at_rest(monkeypatch):
    found = ended(monkeypatch, [(False, NONE), (False, NONE)])
    assert found.settled is True
    assert found.error == 1e-4


def test_what_was_cleared_comes_to_rest_again(monkeypatch):
    assert ended(monkeypatch, [(False, NONE), (True, NONE), (False, NONE)]).settled is True


@pytest.mark.parametrize("target", [0.5, 8.0])
def test_cloth_comes_to_rest_the_same_way_whatever_error_is_asked_for(monkeypatch, target):
    """Friction keeps it where its way has led it: two dresses came to rest 5 mm apart."""
    mesh = sheet(4, 4, 0.1, 0.1)
    model, rest = build_cloth(mesh, RestShape(mesh.vertices), fabric()), RestShape(mesh.vertices)
    asked = []

    def relax(stepper, state, limits, *given):
        asked.append(limits.error)
        return SettlingResult(state, True, 1e-4, 1e-3)

    monkeypatch.setattr(module, "relax_to_rest", relax)
    monkeypatch.setattr(module, "clear_body_crossings", lambda stepper, state, *given: (state, NONE))
    phases = Phases(model, rest, fabric(), DrapeConfig(target_error_mm=target), Job())
    phases.settle_and_clear(at_rest(mesh.vertices), Ready(), ball(0.3, levels=1), np.inf)
    assert asked == [5e-3, pytest.approx(1e-3 * target)]


@pytest.mark.parametrize("pairs", [NONE, ONE], ids=["clear", "still crossing"])
def test_what_the_last_clearing_moved_is_not_at_rest(monkeypatch, pairs):
    turns = module._TURNS - 1 if len(pairs) == 0 else 0
    found = ended(monkeypatch, [(True, NONE)] * turns + [(True, pairs)])
    assert found.settled is False
    assert found.error == np.inf  # what was predicted was of another place
    assert found.not_settled_warning == "not at rest, error unknown"


@pytest.mark.parametrize(("crossings_left", "stretched", "caught"), [(1, 3.0, True), (1, 1.5, False), (0, 3.0, False)])
def test_what_never_came_free_of_the_body_and_is_stretched_about_it_is_not_waited_for(
    monkeypatch, crossings_left, stretched, caught
):
    """A sheet through the middle of a ball, its edges so many times as long as at rest."""
    mesh = sheet(12, 12, 0.4, 0.4)
    middle = mesh.vertices.mean(axis=0)
    phases = Phases(
        build_cloth(mesh, RestShape(mesh.vertices), fabric()), RestShape(mesh.vertices), fabric(), DrapeConfig(), Job()
    )
    phases.crossings_left = crossings_left
    cleared = []

    def clear(stepper, state, *given):
        cleared.append(state)
        return state, ONE

    monkeypatch.setattr(
        module,
        "relax_to_rest",
        lambda stepper, state, limits, watch, is_caught, *given: SettlingResult(
            state, True, 1e-4, 1e-3, caught=is_caught(state.positions)
        ),
    )
    monkeypatch.setattr(module, "clear_body_crossings", clear)
    found = phases.settle_and_clear(at_rest(stretched * (mesh.vertices - middle)), Ready(), ball(0.3, levels=2), np.inf)
    assert found.caught is caught
    assert len(cleared) == (0 if caught else 1)


def growing(monkeypatch, jams, size=1.0):
    """How cloth is grown that jams on so many ways; the bodies that it began about, by their place [m].

    It starts so many times its size.
    """
    mesh = sheet(4, 4, 0.1, 0.1)  # in the ball
    rest = RestShape(mesh.vertices / size)
    model = build_cloth(mesh, rest, fabric())
    body, begun = ball(0.12, levels=1), []
    thinning = Thinning(body)

    def way(place, otherwise):
        moving = MovingBody(np.stack([body.vertices + place, body.vertices]), body.faces)
        return BodyGrowth(mesh, moving, 0, 0, 0, [], thinning, otherwise)

    def run(stepper, state, collider, *given, **settings):
        begun.append(float(np.median(collider.at(0.0)[: len(body.vertices)] - body.vertices)))
        if len(begun) <= jams:
            raise IntersectingError("jammed")
        return state

    ways = way(0.01, way(0.02, None))
    monkeypatch.setattr(BodyGrowth, "from_smaller", lambda growth, times: growth)
    monkeypatch.setattr(module, "plan_body_growth", lambda *given: ways)
    monkeypatch.setattr(module, "run_body_motion", run)
    phases = Phases(model, rest, fabric(), DrapeConfig(grow_above_mm=0.0), Job())
    try:
        phases.grow_body(at_rest(mesh.vertices), body)
    except IntersectingError:
        begun.append(np.nan)
    return begun


def test_cloth_that_jams_begins_again_from_a_thinner_body(monkeypatch):
    assert growing(monkeypatch, 0) == pytest.approx([0.01], abs=1e-9)
    assert growing(monkeypatch, 1) == pytest.approx([0.01, 0.02], abs=1e-9)


def test_cloth_that_jams_on_every_way_is_refused(monkeypatch):
    assert growing(monkeypatch, 2) == pytest.approx([0.01, 0.02, np.nan], abs=1e-9, nan_ok=True)


def test_what_is_far_too_small_is_refused_at_its_first_jam(monkeypatch):
    """A second way costs as much as the first, and jams as well."""
    assert growing(monkeypatch, 1, size=1.2) == pytest.approx([0.01, np.nan], abs=1e-9, nan_ok=True)
    assert growing(monkeypatch, 1, size=1.1) == pytest.approx([0.01, 0.02], abs=1e-9)
    assert growing(monkeypatch, 0, size=1.2) == pytest.approx([0.01], abs=1e-9)


@pytest.mark.parametrize(
    ("place", "left", "pushed_off", "times", "closely"),
    [
        (0.0, 3, 0.0, 1.1, True),
        (0.0, 3, 0.0, 1.2, False),
        (0.0, 3, 0.5, 1.0, False),
        (0.0, 0, 0.0, 1.0, False),
        (1.0, 3, 0.0, 1.0, False),
    ],
)
def test_the_body_grows_closely_where_cloth_does_not_come_off_it(monkeypatch, place, left, pushed_off, times, closely):
    """Cloth across the ball, or far from it and tangled in itself; it is clear of both where features are kept out."""
    mesh, body, asked = moved(sheet(4, 4, 0.4, 0.4), place, 0.0, 0.0), ball(0.1, levels=1), []
    rest = RestShape(mesh.vertices)

    def grown(phases, growth, config):
        asked.append(config.body_features)
        return at_rest(mesh.vertices + 2.0 * config.body_features), None

    def clear(stepper, state, *given):
        return replace(state, positions=state.positions + pushed_off), NONE if pushed_off else ONE

    monkeypatch.setattr(Phases, "_grown", grown)
    monkeypatch.setattr(module, "clear_body_crossings", clear)
    monkeypatch.setattr(
        start_module, "find_collision_free_start", lambda x, *given: Start(x, 3, left, np.zeros(len(x), bool))
    )
    phases = Phases(build_cloth(mesh, rest, fabric()), rest, fabric(), DrapeConfig(), Job())
    found = phases._grown_clear(SimpleNamespace(garment=TriangleMesh(times * rest.positions, mesh.faces)), body)
    assert asked == [False, True][: 1 + closely]
    assert (found.positions == mesh.vertices + 2.0 * closely + pushed_off).all()


def test_a_body_grows_in_accelerated_steps(monkeypatch):
    mesh, small, asked = moved(sheet(4, 4, 0.4, 0.4), 1.0, 0.0, 0.0), ball(0.05, levels=1), []
    body = MovingBody(np.stack([small.vertices, 2.0 * small.vertices]), small.faces)

    def moves_on(stepper, state, *given, only_grows):
        asked.append((stepper._method.accelerated, only_grows))
        return state

    monkeypatch.setattr(module, "run_body_motion", moves_on)
    rest = RestShape(mesh.vertices)
    phases = Phases(build_cloth(mesh, rest, fabric()), rest, fabric(), DrapeConfig(), Job())
    phases._grown(BodyGrowth(mesh, body, 0, 0, 0, [], Thinning(small)), DrapeConfig())
    assert asked == [(True, True)]
