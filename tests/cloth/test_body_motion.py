"""A body whose motion waits for the cloth."""

import numpy as np
import pytest
from cloth_scenes import ball, fabric, tube
from numpy.testing import assert_allclose

import vto_pipeline.cloth.dynamics.body_motion as module
from vto_pipeline.cloth.dynamics.body_motion import VariableSpeedBody, body_travel, is_jammed, run_body_motion
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.errors import IntersectingError
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.mesh import TriangleMesh


def swelling(*radii):
    return MovingBody(np.stack([ball(radius).vertices for radius in radii]), ball(1.0).faces)


def radius_at(body, time):
    return float(np.linalg.norm(body.at(time), axis=1).mean())


def test_a_change_of_pace_neither_jumps_nor_loses_its_way():
    body = VariableSpeedBody(swelling(0.1, 0.2), 2.0, 0.3)
    assert_allclose([radius_at(body, t) for t in (0.0, 0.5, 2.0)], [0.1, 0.125, 0.2], rtol=1e-12)
    body.set_speed(0.5, 0.5)  # three quarters of the way at half the pace
    assert_allclose(body.ends, 3.5, rtol=1e-12)
    assert_allclose([radius_at(body, t) for t in (0.5, 1.5, 3.5, 9.0)], [0.125, 0.15, 0.2, 0.2], rtol=1e-12)
    body.set_speed(1.5, 1.0)
    assert_allclose(body.ends, 2.5, rtol=1e-12)
    assert_allclose([radius_at(body, t) for t in (1.5, 2.0, 2.5)], [0.15, 0.175, 0.2], rtol=1e-12)


def test_the_way_is_that_of_the_body_near_the_cloth():
    mesh = ball(0.1)
    far = np.where(mesh.vertices[:, 1:2] < -0.05, [0.0, -0.5, 0.0], [0.02, 0.0, 0.0])
    body = MovingBody(np.stack([mesh.vertices, mesh.vertices + far]), mesh.faces)
    cap = tube(0.11, 0.05, 36, 5, base=0.12)
    assert_allclose(body_travel(body, cap), 0.02, rtol=1e-9)


@pytest.mark.parametrize("deep", [5e-4, 1.0])
def test_the_body_waits_for_cloth_that_is_deep_in_it_and_ends_as_it_should(deep):
    """A ball swells by a fifth in a twentieth of a second, far faster than a tube in it is led out."""
    mesh = tube(0.092, 0.05, 48, 5, base=-0.025)  # up to 8 mm inside the ball
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric())
    body, done = VariableSpeedBody(swelling(0.1, 0.12), 0.15, 0.3), []
    stepper = Stepper(model, [body], np.full(len(mesh.vertices), 2e-3), StepConfig(recovery_speed=0.05), damping=5.0)
    state = run_body_motion(stepper, at_rest(mesh.vertices), body, deep, done.append)
    assert_allclose(state.time, body.ends, rtol=1e-9)
    assert body.ends > 0.2 if deep < 1.0 else body.ends == pytest.approx(0.15)
    assert done[-1] == 1.0
    assert_allclose(radius_at(body, state.time), 0.12, rtol=1e-9)


def test_depth_is_that_of_the_deepest_vertex_inside():
    body = VariableSpeedBody(swelling(0.1), 0.0, 0.3)
    ring = TriangleMesh(tube(0.094, 0.002, 48, 3, base=-0.001).vertices, tube(0.094, 0.002, 48, 3).faces)
    model = build_cloth(ring, RestShape(ring.vertices), fabric())
    assert body.depth(0.0, ring.vertices) == 0.0  # nothing is known before contacts are found
    stepper = Stepper(model, [body], np.full(len(ring.vertices), 1e-3), StepConfig(recovery_speed=0.01))
    state = stepper.run(at_rest(ring.vertices), 1 / 60)
    assert 3e-3 < body.depth(0.0, state.positions) < 6.1e-3  # 6 mm in at first, led out slowly


@pytest.mark.parametrize(
    ("left", "jammed"),
    [
        ([3900.0, 6300.0], False),  # pushed off at the begin, as a shirt is that starts inside the body
        ([2100.0, 79.0, 50.0, 91.0, 373.0], False),  # a shirt that is led out of the body
        ([8000.0, 5000.0, 3000.0], False),  # far from rest, and on its way there
        ([0.0, 3900.0, 6300.0, 5800.0], True),
        ([1200.0, 900.0, 1500.0], False),
    ],
)
def test_cloth_is_jammed_where_large_forces_do_not_fall(left, jammed):
    assert is_jammed(left) is jammed


def test_a_body_does_not_grow_into_jammed_cloth(monkeypatch):
    mesh = tube(0.11, 0.05, 36, 5, base=-0.025)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric())
    body = VariableSpeedBody(swelling(0.1, 0.105), 0.5, 0.3)
    stepper = Stepper(model, [body], np.full(len(mesh.vertices), 1e-3), StepConfig())
    looks = []
    monkeypatch.setattr(stepper, "residual", lambda state: looks.append(state.time) or 5000.0)
    with pytest.raises(IntersectingError, match="jammed as the body grows, with forces of 5000 times") as caught:
        run_body_motion(stepper, at_rest(mesh.vertices), body, 5e-4, lambda done: None, only_grows=True)
    assert_allclose(looks, [0.05, 0.1, 0.15])  # it is not waited for
    assert caught.value.partial["draped"].faces.shape == mesh.faces.shape
    state = run_body_motion(stepper, at_rest(mesh.vertices), body, 5e-4, lambda done: None)
    assert state.time > 0.5 - 1e-9  # a body that may open again is waited for


@pytest.mark.parametrize(("until", "ends"), [(0.02, True), (1.0, False)])
def test_a_body_that_would_go_through_cloth_all_along_is_not_waited_for(monkeypatch, until, ends):
    """At three hundredths of its pace it takes minutes, and goes through in the end; for a part of its way it may."""
    mesh = tube(0.11, 0.05, 36, 5, base=-0.025)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric())
    body = VariableSpeedBody(swelling(0.1, 0.105), 0.5, 0.3)
    stepper = Stepper(model, [body], np.full(len(mesh.vertices), 1e-3), StepConfig())
    done, gone = [0.0], [0]

    def gone_through(stepper):
        gone[0] += done[-1] < until
        return gone[0]

    monkeypatch.setattr(module, "_gone_through", gone_through)
    start = at_rest(mesh.vertices)
    if ends:
        state = run_body_motion(stepper, start, body, 5e-4, done.append, only_grows=True)
        assert body.ends - 1e-9 <= state.time < 8.0 * 0.5
        return
    with pytest.raises(IntersectingError, match="would go through the cloth as it grows, however slowly"):
        run_body_motion(stepper, start, body, 5e-4, done.append, only_grows=True)
    assert len(done) - 1 == pytest.approx(8.0 * 0.5 / 0.05, abs=1)


def test_what_a_method_that_solves_in_part_leaves_over_is_no_jam(monkeypatch):
    mesh = tube(0.11, 0.05, 36, 5, base=-0.025)
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric())
    body = VariableSpeedBody(swelling(0.1, 0.105), 0.5, 0.3)
    stepper = Stepper(model, [body], np.full(len(mesh.vertices), 1e-3), StepConfig(solver="xpbd", substeps=10))
    monkeypatch.setattr(stepper, "residual", lambda state: 5000.0)
    state = run_body_motion(stepper, at_rest(mesh.vertices), body, 5e-4, lambda done: None, only_grows=True)
    assert state.time > 0.5 - 1e-9
