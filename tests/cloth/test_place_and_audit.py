"""The place of a garment, the growing body, the judge, and the last pass."""

import numpy as np
import pytest
from cloth_scenes import ball, box, fabric, moved, sheet, tube
from numpy.testing import assert_allclose

from vto_pipeline.cloth.audit import audit
from vto_pipeline.cloth.build import at_rest, build
from vto_pipeline.cloth.clear import clear_of_body
from vto_pipeline.cloth.collision.body import BodyCollider
from vto_pipeline.cloth.grow import growing
from vto_pipeline.cloth.place import PlaceConfig, place
from vto_pipeline.cloth.rest_shape import RestShapeConfig, rest_shape
from vto_pipeline.cloth.stepper import StepConfig, Stepper
from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def skittle():
    """A closed body with a waist at y = 0.6 and a foot at y = 0."""
    mesh = ball(1.0, levels=4)
    x, y, z = mesh.vertices.T
    girth = 0.15 - 0.09 * np.exp(-(((y - 0.2) / 0.25) ** 2))
    return TriangleMesh(np.column_stack([girth * x, 0.5 + 0.5 * y, girth * z]), mesh.faces)


def spool():
    """A thick rod with a groove of radius 0.08 from y = 0.52 to 0.68."""
    mesh = tube(1.0, 1.0, 64, 101)
    y = mesh.vertices[:, 1]
    radius = np.where(np.abs(y - 0.6) < 0.08, 0.08, 0.15) * np.where((y < 1e-9) | (y > 1 - 1e-9), 1e-3, 1.0)
    return TriangleMesh(mesh.vertices * np.column_stack([radius, np.ones_like(y), radius]), mesh.faces)


@pytest.mark.parametrize("flip", [False, True])
def test_a_collar_goes_to_the_groove_it_was_made_for(flip):
    body = spool()
    collar = tube(0.09, 0.1, 36, 8, base=0.55)
    strayed = moved(collar, 0.3, -0.2, 0.15)
    if flip:
        strayed = TriangleMesh(strayed.vertices, strayed.faces[:, ::-1])
    job = Job()
    found = place(strayed, body, PlaceConfig(cube_mm=10), job)
    assert_allclose(found.vertices[:, [0, 2]].mean(axis=0), 0.0, rtol=0, atol=0.012)  # one cube
    assert_allclose(found.vertices[:, 1].mean(), 0.6, rtol=0, atol=0.03)
    assert "garment moved by (-3" in job.notes[0]


def test_a_garment_wider_than_the_body_is_centred():
    hoop = moved(tube(0.165, 0.4, 48, 12, base=0.05), 0.25, 0.0, -0.4)
    found = place(hoop, spool(), PlaceConfig(cube_mm=10), Job())
    assert_allclose(found.vertices[:, [0, 2]].mean(axis=0), 0.0, rtol=0, atol=0.015)  # what play there is, and one cube


def test_a_garment_that_stands_well_is_left_alone():
    collar = tube(0.09, 0.1, 36, 8, base=0.55)
    job = Job()
    assert place(collar, spool(), PlaceConfig(cube_mm=10), job) is collar
    assert job.notes[0].startswith("garment left where it stands")


def test_the_body_grows_from_where_it_no_longer_crosses():
    collar = tube(0.1, 0.3, 48, 24, base=0.35)  # cuts the skittle below its waist, where it is up to 0.15 m
    body = skittle()
    motion = growing(body, collar, Job())
    assert len(intersecting_faces(collar, body)) > 0
    assert len(intersecting_faces(collar, TriangleMesh(motion.keyframes[0], body.faces))) == 0
    assert_allclose(motion.keyframes[-1], body.vertices, rtol=0, atol=0)
    radius = np.linalg.norm(motion.keyframes[:, :, [0, 2]], axis=2).mean(axis=1)
    assert (np.diff(radius) > 0).all()


def test_a_garment_through_the_heart_of_the_body_is_warned_of():
    job = Job()
    through = moved(sheet(40, 40, 0.6, 0.6, upright=False), -0.3, 0.5, -0.3)
    growing(skittle(), through, job)
    assert "does not surround the body" in job.warnings[0]


def test_the_judge_sees_what_was_done_to_the_cloth():
    body = box((0.4, 0.1, 0.4))
    rest = sheet(9, 9, 0.2, 0.2, upright=False)
    mesh = TriangleMesh((rest.vertices - [0.1, 0, 0.1]) * [1.1, 1, 1] + [0, 0.04, 0], rest.faces)
    found = audit(mesh, RestShape(rest.vertices), body, settled=False, energy=1.5, residual=0.25)
    assert found["finite"] is True
    assert found["settled"] is False
    assert_allclose(found["penetration_mm"], 10.0, rtol=1e-9)  # 10 mm under the top of the box
    assert_allclose(found["min_clearance_mm"], -10.0, rtol=1e-9)
    assert_allclose(found["max_stretch"], 0.1, rtol=1e-9)
    assert_allclose(found["area_change"], 0.1, rtol=1e-9)
    assert found["body_intersections"] == 0  # wholly inside: no triangles cross
    assert found["self_intersections"] == 0
    lifted = moved(mesh, 0.25, 0, 0)  # now through the side
    assert audit(lifted, RestShape(rest.vertices), body, settled=True, energy=0, residual=0)["body_intersections"] > 0


def test_the_judge_counts_self_intersections():
    one = sheet(5, 5, 0.2, 0.2, upright=False)
    other = moved(sheet(5, 5, 0.2, 0.2), 0.013, 0.1, 0.11)
    both = TriangleMesh(np.vstack([one.vertices, other.vertices]), np.vstack([one.faces, other.faces + 25]))
    found = audit(both, RestShape(both.vertices), None, settled=True, energy=0.0, residual=0.0)
    assert found["self_intersections"] >= 4
    assert found["min_clearance_mm"] is None


def test_a_spike_between_the_vertices_is_cleared():
    block = box((0.4, 0.1, 0.4))
    vertices = block.vertices.copy()
    vertices[np.linalg.norm(vertices - [0, 0.05, 0], axis=1).argmin(), 1] += 0.02
    spiked = TriangleMesh(vertices, block.faces)
    mesh = sheet(4, 4, 0.15, 0.15, upright=False)
    mesh = moved(mesh, -0.075, 0.055, -0.075)
    model = build(mesh, RestShape(mesh.vertices), fabric())
    body = MovingBody(spiked.vertices[None], spiked.faces)
    stepper = Stepper(model, [BodyCollider(body, 0.0, 0.3)], np.full(16, 1e-3), StepConfig(), damping=5.0)
    state = stepper.run(at_rest(mesh.vertices), 0.2)
    assert len(intersecting_faces(TriangleMesh(state.positions, mesh.faces), spiked)) > 0
    state, pairs = clear_of_body(stepper, state, mesh.faces, spiked, 40)
    assert len(pairs) == 0
    assert len(intersecting_faces(TriangleMesh(state.positions, mesh.faces), spiked)) == 0
    assert 1e-3 < stepper.skin.max() < 0.03


def test_rest_shape_as_scanned():
    mesh, job = sheet(3, 3, 1, 1), Job()
    found = rest_shape(mesh, RestShapeConfig(), job)
    assert found.mode == "as_scanned"
    assert_allclose(found.positions, mesh.vertices, rtol=0, atol=0)
    assert "as scanned" in job.notes[0]
