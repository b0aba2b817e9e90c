"""A garment that is too small for where it is worn starts larger there, and is not led to where it would fit."""

from __future__ import annotations

import numpy as np
import pytest
from cloth_scenes import ball, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.placement.body_growth import plan_body_growth
from vto_pipeline.geometry.intersections import intersecting_faces, self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

NECK, TRUNK = 0.04, 0.15  # m


def bottle() -> TriangleMesh:
    """A trunk up to y = 0.45 m, and above it a neck, half as long as the whole."""
    mesh = ball(1.0, levels=4)
    x, y, z = mesh.vertices.T
    height = 0.5 + 0.5 * y
    girth = NECK + (TRUNK - NECK) / (1.0 + np.exp((height - 0.5) / 0.03))
    flank = np.sqrt(np.maximum(1 - np.abs(y) ** 8, 0)) / np.maximum(np.sqrt(np.maximum(1 - y * y, 0)), 1e-9)
    return TriangleMesh(np.column_stack([girth * flank * x, height, girth * flank * z]), mesh.faces)


def skirt(waist: float, hem: float, base: float, length: float) -> TriangleMesh:
    """A cone about the y axis, its hem at y = base; lengths and radii in m."""
    mesh = tube(1.0, length, 48, 24, base=base)
    radius = hem + (waist - hem) * (mesh.vertices[:, 1] - base) / length
    return TriangleMesh(mesh.vertices * np.column_stack([radius, np.ones_like(radius), radius]), mesh.faces)


@pytest.mark.parametrize("base", [0.1, 0.2])
def test_a_tight_skirt_stays_at_the_trunk(base):
    body, garment, job = bottle(), skirt(0.05, 0.2, base, 0.25 if base < 0.2 else 0.2), Job()
    growth = plan_body_growth(body, garment, job)
    assert len(intersecting_faces(garment, body)) > 0
    assert growth.crossing == 0
    assert growth.garment.vertices[:, 1].max() < 0.5  # where the neck begins; it was led 0.2 m up
    assert job.warnings


def test_cloth_that_is_no_size_too_small_is_not_enlarged():
    plate = TriangleMesh(np.array([[-0.3, 0.3, -0.3], [0.3, 0.3, -0.3], [0.3, 0.3, 0.3], [-0.3, 0.3, 0.3]]), FACES)
    job = Job()
    growth = plan_body_growth(bottle(), plate, job)
    assert growth.crossing > 0
    assert not any("too small" in text for text in job.warnings)


@pytest.mark.parametrize("base", [0.1, 0.3])
def test_what_starts_larger_starts_in_its_own_size_on_a_smaller_body(base):
    """What is about the smaller body is about the larger one; at the end the body is as it was given."""
    body, garment = bottle(), skirt(0.16, 0.2, base, 0.1)
    larger = TriangleMesh(1.3 * garment.vertices - [0.0, 0.3 * (base + 0.05), 0.0], garment.faces)
    growth = plan_body_growth(body, larger, Job())
    smaller = growth.from_smaller(1.3)
    assert_allclose(smaller.garment.vertices, garment.vertices, rtol=0, atol=1e-12)
    assert_allclose(smaller.body.keyframes[-1], body.vertices, rtol=0, atol=1e-12)
    thin = TriangleMesh(smaller.body.keyframes[0], body.faces)
    assert len(smaller.body.keyframes) > 1
    assert len(intersecting_faces(smaller.garment, thin)) == growth.crossing == 0
    own = SurfaceDistance(TriangleMesh(growth.body.keyframes[0], body.faces)).signed(larger.vertices).distance
    here = SurfaceDistance(thin).signed(smaller.garment.vertices).distance
    assert_allclose(1.3 * here, own, rtol=0, atol=1e-9)


def test_a_start_that_crosses_itself_is_faulty():
    garment = skirt(0.2, 0.2, 0.1, 0.25)
    x = garment.vertices.copy()
    x[len(x) // 2] *= [-1.1, 1.0, -1.1]  # a spike through the other side
    assert plan_body_growth(bottle(), garment, Job()).fault == (0, 0)
    found = plan_body_growth(bottle(), TriangleMesh(x, garment.faces), Job())
    assert found.tangled == len(self_intersections(found.garment))
    assert found.tangled > 0
    assert found.fault[0] >= found.tangled


FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
