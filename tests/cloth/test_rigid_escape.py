"""Garments that start beyond a limb's axis: led about the body as a whole, and clean in the end."""

import numpy as np
import pytest
from cloth_scenes import ball, fabric, moved, tube
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.placement.body_growth import lead_to_body
from vto_pipeline.cloth.placement.rigid_escape import escape_rigidly
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

AROUND = 20
QUICK = {"place": "as_it_stands", "target_error_mm": 3.0, "settle_seconds": 1.5}


def trunk_and_limb():
    """A closed body about the y axis: a trunk of radius 0.1 m up to y = 0.08, a limb of 0.03 m up to y = 0.4."""
    mesh = ball(1.0, levels=4)
    x, y, z = mesh.vertices.T
    height = 0.15 + 0.25 * y
    girth = (0.03 + 0.07 * _below(height, 0.08)) * np.minimum(1.0, 2.0 * np.hypot(x, z))
    angle = np.arctan2(z, x)
    return TriangleMesh(np.column_stack([girth * np.cos(angle), height, girth * np.sin(angle)]), mesh.faces)


def bodice_and_sleeve():
    """A tube 20 mm wider than the trunk and 15 mm wider than the limb."""
    mesh = tube(1.0, 0.3, AROUND, 22, base=-0.05)
    x, y, z = mesh.vertices.T
    girth = 0.045 + 0.075 * _below(y, 0.09)
    return TriangleMesh(np.column_stack([girth * x, y, girth * z]), mesh.faces)


def _below(height, edge):
    return 1.0 / (1.0 + np.exp((height - edge) / 0.015))


def turns_about_the_limb(vertices):
    """How often the last but one ring of the sleeve goes around the y axis."""
    x, _, z = vertices[-2 * AROUND : -AROUND].T
    angle = np.unwrap(np.arctan2(z, x), period=2 * np.pi)
    last = np.angle(np.exp(1j * (angle[0] - angle[-1])))
    return (angle[-1] - angle[0] + last) / (2 * np.pi)


@pytest.mark.parametrize("inward", [False, True])
def test_a_garment_shifted_and_turned_is_led_back_without_a_change_of_lengths(inward):
    body, garment = trunk_and_limb(), bodice_and_sleeve()
    if inward:
        garment = TriangleMesh(garment.vertices, garment.faces[:, ::-1].copy())
    strayed = garment.vertices @ Rotation.from_rotvec([0.0, 0.0, 0.2]).as_matrix().T + np.array([0.08, 0.0, 0.03])
    led = escape_rigidly(body, TriangleMesh(strayed, garment.faces))
    assert abs(turns_about_the_limb(strayed)) < 1e-9
    assert_allclose(abs(turns_about_the_limb(led)), 1.0, rtol=0, atol=1e-9)
    assert SurfaceDistance(body).signed(strayed).distance.min() < -0.02
    assert SurfaceDistance(body).signed(led).distance.min() > -0.005
    ends = edges(garment)
    was, now = (np.linalg.norm(np.diff(x[ends], axis=1)[:, 0], axis=1) for x in (garment.vertices, led))
    assert_allclose(now, was, rtol=1e-9)


def test_a_garment_with_no_cloth_in_the_body_stays():
    garment = bodice_and_sleeve()
    assert_array_equal(escape_rigidly(trunk_and_limb(), garment), garment.vertices)


def test_cloth_that_cuts_only_into_a_limb_that_can_be_thinned_is_not_led():
    job, body, garment = Job(), trunk_and_limb(), moved(bodice_and_sleeve(), 0.03, 0.0, 0.0)
    assert len(intersecting_faces(garment, body)) > 0
    found = lead_to_body(body, garment, job)
    assert_array_equal(found.garment.vertices, garment.vertices)
    assert job.warnings == []


def test_a_sleeve_beyond_the_axis_of_its_limb_ends_about_it():
    body, job = trunk_and_limb(), Job()
    start = moved(bodice_and_sleeve(), 0.06, 0.0, 0.0)  # the sleeve's far side is 15 mm before the limb's axis
    assert abs(turns_about_the_limb(start.vertices)) < 1e-9
    found = drape(start, body, fabric(bending=1e-5), QUICK, job)
    assert len(intersecting_faces(found.mesh, body)) == 0
    assert_allclose(abs(turns_about_the_limb(found.mesh.vertices)), 1.0, rtol=0, atol=1e-9)
    assert found.audit["largest_strain"] < 0.1
    assert any("before the body grows" in text for text in job.warnings)
