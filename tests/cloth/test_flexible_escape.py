"""Garments whose parts point another way than the body's: led part by part, nearly rigid."""

import numpy as np
import pytest
from cloth_scenes import ball, moved, tube
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.placement.body_growth import plan_body_growth
from vto_pipeline.cloth.placement.flexible_escape import escape_flexibly
from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.cloth.placement.rigidity import Rigidity
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, edges
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

AROUND, LONG, KNEE = 24, 0.4, 0.45


def limb(bend):
    """A limb of 0.05 m about the y axis, 1 m long, bent about x at y = 0.45 by an angle [rad]."""
    mesh = ball(1.0, levels=5)
    x, y, z = mesh.vertices.T
    round_off = 0.05 * np.minimum(1.0, 3.0 * np.hypot(x, z)) / np.maximum(np.hypot(x, z), 1e-9)
    straight = np.column_stack([round_off * x, 0.5 + 0.5 * y, round_off * z])
    return TriangleMesh(bent(straight, bend), mesh.faces)


def bent(points, angle):
    """Points turned about the knee, those within 0.1 m of it by a part of the angle."""
    along = np.clip((points[:, 1] - KNEE + 0.1) / 0.2, 0.0, 1.0) * angle
    knee = np.array([0.0, KNEE, 0.0])
    return Rotation.from_rotvec(np.outer(along, [1.0, 0.0, 0.0])).apply(points - knee) + knee


def trouser_leg():
    """A straight tube 15 mm wider than the limb."""
    return tube(0.065, LONG, AROUND, 30, base=0.3)


def turns_about_the_limb(vertices, bend):
    """How often the last ring goes around the limb, seen where that is straight."""
    knee = np.array([0.0, KNEE, 0.0])
    x, _, z = (Rotation.from_rotvec([-bend, 0.0, 0.0]).apply(vertices[-AROUND:] - knee)).T
    angle = np.arctan2(z, x)
    steps = np.diff(np.append(angle, angle[0]))
    return np.angle(np.exp(1j * steps)).sum() / (2 * np.pi)


@pytest.mark.parametrize("bend", [-0.5, 0.5])
@pytest.mark.parametrize("inward", [False, True])
def test_a_straight_leg_is_led_about_a_bent_one_with_hardly_a_change_of_lengths(bend, inward):
    body, garment = limb(bend), trouser_leg()
    if inward:
        garment = TriangleMesh(garment.vertices, garment.faces[:, ::-1].copy())
    assert abs(turns_about_the_limb(garment.vertices, bend)) < 1e-9
    rigid = escape_rigidly(body, garment)
    assert len(intersecting_faces(TriangleMesh(rigid, garment.faces), body)) > 0
    led = escape_flexibly(body, TriangleMesh(rigid, garment.faces))
    assert_allclose(abs(turns_about_the_limb(led, bend)), 1.0, rtol=0, atol=1e-9)
    assert SurfaceDistance(body).signed(led).distance.min() > -0.005
    ends = edges(garment)
    was, now = (np.linalg.norm(np.diff(x[ends], axis=1)[:, 0], axis=1) for x in (garment.vertices, led))
    assert_allclose(np.median(now / was), 1.0, rtol=0.01)  # bent, not stretched
    assert_allclose(now / was, 1.0, rtol=0.35)  # but for the wrinkles of the knee


@pytest.mark.parametrize("bend", [-0.5, 0.5])
def test_what_lies_on_a_leg_is_led_with_it_and_does_not_cross_it(bend):
    """A band about the knee, 4 mm outside, of which nothing is in the body: it would stay, and the leg would not."""
    leg = trouser_leg()
    both = concatenate([leg, tube(0.069, 0.15, AROUND, 12, base=0.38)])
    led = escape_flexibly(limb(bend), both)
    assert len(self_intersections(TriangleMesh(led, both.faces))) == 0
    inner, outer = led[: len(leg.vertices)], led[len(leg.vertices) :]
    assert np.linalg.norm(inner - leg.vertices, axis=1).max() > 0.03
    away = SurfaceDistance(TriangleMesh(inner, leg.faces)).nearest(outer).distance
    assert away.min() > 0.002
    assert away.max() < 0.007


def test_legs_that_face_each_other_go_their_own_ways():
    """Two tubes 5 mm apart, of which one is asked to go aside."""
    leg = trouser_leg()
    both = concatenate([leg, moved(leg, 0.135, 0.0, 0.0)])
    one = np.arange(len(both.vertices)) < len(leg.vertices)
    wanted = both.vertices - np.outer(one, [0.1, 0.0, 0.0])
    led = Rigidity(both).follow(both.vertices, wanted, np.where(one, 1.0, 1e-3))
    assert_allclose(led, wanted, rtol=0, atol=1e-9)


def test_a_garment_with_no_cloth_in_the_body_stays():
    garment = trouser_leg()
    assert_array_equal(escape_flexibly(limb(0.0), garment), garment.vertices)


def test_the_way_in_leads_parts_where_the_whole_will_not_do():
    body, job = limb(0.6), Job()
    found = plan_body_growth(body, trouser_leg(), job)
    thinnest = TriangleMesh(found.body.keyframes[0], body.faces)
    assert len(intersecting_faces(found.garment, thinnest)) == 0
    assert_allclose(abs(turns_about_the_limb(found.garment.vertices, 0.6)), 1.0, rtol=0, atol=1e-9)
    assert "before the body grows" in job.warnings[0]
