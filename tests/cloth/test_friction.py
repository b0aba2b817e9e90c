"""Friction against closed forms: slope, slide, capstan, stick and slip, and what an impact may take."""

import numpy as np
import pytest
from cloth_scenes import fabric, sheet
from numpy.testing import assert_allclose

from vto_pipeline import cloth
from vto_pipeline.bench.collision.capstan import heavy_end_sinks, slipping_ratio
from vto_pipeline.bench.collision.friction import incline
from vto_pipeline.bench.collision.stick_slip import slipping_shortening
from vto_pipeline.bench.physics.closed_forms import capstan, slide
from vto_pipeline.bench.physics.elastica import held_strip, slipping_strip
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.units import GRAVITY

DEFAULT = {"solver": "newton"}
FRICTIONS = [0.1, 0.3, 0.5, 0.6, 0.9]
EULER = ["newton", "xpbd", "backward_euler"]  # of first order: they slide a h² n (n + 1) / 2


@pytest.mark.parametrize("method", EULER)
@pytest.mark.parametrize("friction", FRICTIONS)
def test_holds_and_slides_half_a_percent_from_the_limit(method, friction):
    """What slides at 1.005 μ goes as far as the closed form says; what holds at 0.995 μ goes nowhere."""
    held, _ = incline({"solver": method}, 0.995 * friction, friction)
    slid, steps = incline({"solver": method}, 1.005 * friction, friction)
    wanted = slide(friction, np.arctan(1.005 * friction), GRAVITY, 1.0 / steps, steps)
    assert wanted > 1e-3
    assert_allclose(held, 0.0, rtol=0, atol=1e-3 * wanted)
    assert_allclose(slid, wanted, rtol=0.01)  # a linear solve may leave a hundredth of the force


@pytest.mark.parametrize("method", EULER)
@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_slides_as_far_as_the_closed_form(method, friction):
    slid, steps = incline(
        {"solver": method, **({"substeps": 1} if method == "newton" else {})}, 1.2 * friction, friction
    )
    wanted = slide(friction, np.arctan(1.2 * friction), GRAVITY, 1.0 / steps, steps)
    assert_allclose(slid, wanted, rtol=1e-5)
    tilt = np.arctan(1.2 * friction)
    continuous = 0.5 * GRAVITY * (np.sin(tilt) - friction * np.cos(tilt))
    assert_allclose(wanted / continuous, 1.0 + 1.0 / steps, rtol=1e-9)  # the textbook's, and the error of the steps


@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_slides_as_far_at_its_own_pace_but_for_what_free_fall_loses(friction):
    slid, steps = incline(DEFAULT, 1.2 * friction, friction)
    tilt = np.arctan(1.2 * friction)
    continuous = 0.5 * GRAVITY * (np.sin(tilt) - friction * np.cos(tilt))
    assert steps < 30  # of 60
    assert abs(slid - continuous) < 1.1 * 0.5 * GRAVITY / 60.0


def test_the_strip_of_the_capstan_slips_and_holds_where_it_is_far_from_the_limit():
    exact = capstan(0.3, np.pi)
    assert_allclose(exact, 2.5663, rtol=1e-4)  # exp(0.3 π)
    assert abs(heavy_end_sinks(DEFAULT, 0.3, 0.7 * exact)) < 1e-3
    free = heavy_end_sinks(DEFAULT, 0.0, 1.01)
    atwood = 0.5 * GRAVITY * 0.01 / 2.01 * (1.0 - 0.75**2)
    assert 0.1 * atwood < free < 1.05 * atwood  # what a linear solve leaves of the load may hold it back, not drive it


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.5])
def test_capstan(friction):
    assert_allclose(slipping_ratio(DEFAULT, friction), capstan(friction, np.pi), rtol=0.03)


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.3])
def test_stick_slip(friction):
    assert_allclose(slipping_shortening(DEFAULT, friction), slipping_strip(friction), rtol=0.05)


def test_the_truth_of_stick_slip_is_the_elastica():
    """Onset and load of the inextensible strip, integrated elsewhere to 1e-10."""
    assert_allclose([slipping_strip(mu) for mu in (0.1, 0.2, 0.3)], [0.047, 0.155, 0.272], rtol=0, atol=5e-4)
    strip = held_strip(0.2)
    assert_allclose([strip.holding_friction, strip.down], [0.23777, 21.721], rtol=3e-5)
    assert_allclose(strip.shape[-1], [0.0, 0.8], rtol=0, atol=1e-9)
    assert_allclose(np.linalg.norm(np.diff(strip.shape, axis=0), axis=1).sum(), 1.0, rtol=1e-4)  # chords of 200 arcs


@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_a_leaning_gravity_is_slowed_by_friction_alone(friction):
    """On a floor under a gravity that leans: it goes on with what μ times the weight leaves of it."""
    mesh = sheet(6, 6, 0.1, 0.1, upright=False)
    fall, along = 0.3, 1.0
    start = TriangleMesh(mesh.vertices + np.array([0.0, 0.001, 0.0]), mesh.faces)
    ramp = cloth.Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), friction)
    ended = cloth.simulate(
        start,
        fabric(),
        colliders=[ramp],
        seconds=0.1,
        settings={"skin_mm": 1.0, "gravity": (GRAVITY * along, -GRAVITY * fall, 0.0)},
    )
    expected = GRAVITY * (along - friction * fall) * 0.1
    assert_allclose(ended.velocities[:, 0], expected, rtol=0.01)
    assert_allclose(ended.velocities[:, 1], 0.0, rtol=0, atol=1e-3)


@pytest.mark.slow
def test_a_pile_at_rest_stays_at_rest():
    from dataclasses import replace

    from vto_pipeline.bench.collision.scenes import pile

    scene = pile(6)
    rest, later = (replace(scene, seconds=seconds).run().positions for seconds in (2.0, 12.0))
    assert np.linalg.norm(later - rest, axis=1).max() < 1e-4
    assert np.ptp(rest[:, 1]) > 3e-3  # five layers, not one
