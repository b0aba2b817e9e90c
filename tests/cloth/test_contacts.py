"""Cloth on things: friction, spheres, moving bodies, bad starts."""

import numpy as np
import pytest
from cloth_scenes import ball, box, fabric, moved, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from vto_pipeline import cloth
from vto_pipeline.cloth.build import at_rest, build
from vto_pipeline.cloth.collision.body import BodyCollider
from vto_pipeline.cloth.collision.contacts import Round
from vto_pipeline.cloth.stepper import StepConfig, Stepper
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

G = 9.80665


def on_an_incline(slope, friction, seconds):
    mesh = sheet(4, 4, 0.1, 0.1, upright=False)
    tilt = np.arctan(slope)
    along = np.array([np.cos(tilt), -np.sin(tilt), 0.0])
    normal = np.array([np.sin(tilt), np.cos(tilt), 0.0])
    start = np.outer(mesh.vertices[:, 0], along) + mesh.vertices[:, [2]] * [0, 0, 1] + 0.001 * normal
    plane = cloth.Plane((0, 0, 0), tuple(normal), friction)
    found = cloth.simulate(
        TriangleMesh(start, mesh.faces), fabric(), colliders=[plane], seconds=seconds, settings={"skin_mm": 1.0}
    )
    return (found.positions - start) @ along, (found.positions @ normal), found.report


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_slides_as_the_textbook_says(friction):
    slope = 1.2 * friction
    slid, height, report = on_an_incline(slope, friction, 1.0)
    tilt, n = np.arctan(slope), report["steps"]
    assert n == 60 * report["substeps"]
    wanted = G * (np.sin(tilt) - friction * np.cos(tilt)) * (n + 1) / (2 * n)  # a h² n (n + 1) / 2, with n h = 1 s
    assert_allclose(slid, wanted, rtol=0.01)  # what a linear solve may leave of the force
    assert_allclose(height, 0.001, rtol=0, atol=1e-6)  # stays on its skin


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.6])
def test_holds_below_the_angle_of_friction(friction):
    slid, _, _ = on_an_incline(0.95 * friction, friction, 1.0)
    assert_allclose(slid, 0.0, rtol=0, atol=1e-6)  # at rest from the first step


@pytest.mark.parametrize("shape", ["sphere", "mesh"])
def test_a_sheet_dropped_on_a_ball_ends_outside(shape):
    mesh = sheet(25, 25, 0.5, 0.5, upright=False)
    mesh = TriangleMesh(mesh.vertices - [0.25, -0.23, 0.25], mesh.faces)
    thing = cloth.Sphere((0, 0, 0), 0.2, 0.5) if shape == "sphere" else cloth.MeshCollider(ball(0.2), 0.5)
    found = cloth.simulate(mesh, fabric(bending=1e-5), colliders=[thing], seconds=1.0, settings={"damping": 1.0})
    distance = np.linalg.norm(found.positions, axis=1)
    assert 0.2 < distance.min() < 0.205
    assert found.positions[:, 1].min() < 0.1  # it did come down over the ball
    middle = found.positions[mesh.faces].mean(axis=1)
    assert np.linalg.norm(middle, axis=1).min() > 0.2  # nor do its triangles cut in


def test_a_capsule_carries_a_sheet():
    mesh = sheet(15, 15, 0.3, 0.3, upright=False)
    mesh = TriangleMesh(mesh.vertices - [0.15, -0.08, 0.15], mesh.faces)
    rod = cloth.Capsule((-0.3, 0, 0), (0.3, 0, 0), 0.05, 0.8)
    found = cloth.simulate(mesh, fabric(), colliders=[rod], seconds=0.5, settings={"damping": 2.0})
    off_axis = np.linalg.norm(found.positions[:, 1:], axis=1)
    assert 0.05 < off_axis.min() < 0.054
    assert found.positions[:, 1].max() > 0.05


def stepper_on(body, seconds, mesh, job=None, friction=0.6, skin=2e-3):
    model = build(mesh, RestShape(mesh.vertices), fabric(bending=1e-6))
    collider = BodyCollider(body, seconds, friction, job)
    return Stepper(model, [collider], np.full(len(mesh.vertices), skin), StepConfig(), damping=2.0, max_speed=2.0)


def test_a_moving_body_takes_the_cloth_along():
    block = box((0.4, 0.1, 0.4))
    frames = block.vertices + np.linspace(0, 1, 4)[:, None, None] * np.array([0.1, 0.0, 0.0])
    mesh = sheet(8, 8, 0.1, 0.1, upright=False)
    mesh = moved(mesh, -0.05, 0.052, -0.05)
    stepper = stepper_on(MovingBody(frames, block.faces), 1.0, mesh)
    state = stepper.run(stepper.run(at_rest(mesh.vertices), 1.0), 0.2)
    assert_allclose(state.positions - mesh.vertices, np.broadcast_to([0.1, 0, 0], mesh.vertices.shape), atol=1e-3)


def test_a_turning_body_turns_its_contact_normals():
    block = box((0.4, 0.1, 0.4))
    angles = np.linspace(0, np.pi / 8, 8)
    turns = [np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in angles]
    frames = np.stack([block.vertices @ turn.T for turn in turns])
    mesh = sheet(8, 8, 0.1, 0.1, upright=False)
    mesh = moved(mesh, -0.05, 0.052, -0.05)
    stepper = stepper_on(MovingBody(frames, block.faces), 1.0, mesh)
    state = stepper.run(at_rest(mesh.vertices), 1.2)
    height = (state.positions @ turns[-1])[:, 1]
    assert_allclose(height, 0.052, rtol=0, atol=2e-4)  # on its skin, and friction 0.6 holds at 22.5°


def test_cloth_that_starts_inside_is_led_out_not_thrown():
    mesh = sheet(21, 21, 0.3, 0.3, upright=False)
    mesh = moved(mesh, -0.15, 0.11, -0.15)  # a cap of it is 4 cm deep
    body = MovingBody(ball(0.15).vertices[None], ball(0.15).faces)
    stepper = stepper_on(body, 0.0, mesh)
    state, fastest = at_rest(mesh.vertices), 0.0
    for _ in range(60):
        state = stepper.run(state, 1 / 60)
        fastest = max(fastest, float(np.linalg.norm(state.velocities, axis=1).max()))
    assert np.linalg.norm(state.positions, axis=1).min() > 0.15
    assert 0.4 < fastest < 2.0


def test_a_resting_body_is_never_refitted_and_the_result_is_the_same():
    mesh = sheet(21, 21, 0.3, 0.3, upright=False)
    mesh = moved(mesh, -0.15, 0.16, -0.15)
    results = []
    for force_all in (False, True):
        job = Job(force_all=force_all)
        stepper = stepper_on(MovingBody(ball(0.15).vertices[None], ball(0.15).faces), 0.0, mesh, job)
        results.append(stepper.run(at_rest(mesh.vertices), 0.4).positions)
        assert job.left_out == ([] if force_all else [("refitting the body's tree", "the body is at rest")])
    assert np.abs(results[0] - mesh.vertices).max() > 0.05
    assert_array_equal(*results)


def test_above_the_rim_of_an_open_body_nothing_pushes():
    block = box((0.4, 0.1, 0.4))
    open_top = TriangleMesh(block.vertices, block.faces[block.vertices[block.faces].min(axis=1)[:, 1] < 0.05])
    mesh = sheet(6, 6, 0.2, 0.2, upright=False)
    mesh = moved(mesh, -0.1, 0.06, -0.1)
    stepper = stepper_on(MovingBody(open_top.vertices[None], open_top.faces), 0.0, mesh)
    state = stepper.run(at_rest(mesh.vertices), 0.1)
    assert (state.positions[:, 1] < 0.06 - 0.01).all()  # falls in freely: ½ g t² is 49 mm, less the damping


def test_contact_planes_ride_on_a_turning_body():
    block = box((0.4, 0.1, 0.4))
    turn = Rotation.from_rotvec([0.2, -0.5, 0.3]).as_matrix().T
    shift = np.array([0.1, 0.2, 0.3])
    body = MovingBody(np.stack([block.vertices, block.vertices @ turn + shift]), block.faces)
    points = np.random.default_rng(0).uniform(-0.25, 0.25, (200, 3)) * [1, 0.4, 1]  # on all sides, edges and corners
    span = Round(0.0, 1.0, 0.05, np.full(200, 2e-3), 0.5)
    found = BodyCollider(body, 1.0, 0.3).contacts(points, span)
    near = found.active[0]
    assert near.all()
    assert_allclose(found.normal[0, :, 1], found.normal[0, :, 0] @ turn, rtol=0, atol=1e-12)  # rigid motion
    assert_allclose(found.point[0, :, 1], found.point[0, :, 0] @ turn + shift, rtol=0, atol=1e-12)
    gap = np.einsum("ij,ij->i", points - found.point[0, :, 0], found.normal[0, :, 0])
    inside = (np.abs(points) < [0.2, 0.05, 0.2]).all(axis=1)
    assert 20 < inside.sum() < 180
    assert ((gap < 0) == inside).all()
    assert_allclose(found.offset[0, :, 0], np.minimum(gap, 2e-3), rtol=0, atol=1e-12)  # from where it is, to the skin
    assert_allclose(found.offset[0, :, 1], np.minimum(found.offset[0, :, 0] + 0.5, 2e-3), rtol=0, atol=1e-12)
