"""Cloth on things: friction, spheres, moving bodies, bad starts, bodies that are not clean."""

from pathlib import Path

import numpy as np
import pytest
from cloth_scenes import ball, box, fabric, moved, sheet
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation
from unclean_bodies import doubled, fine_box, flipped, from_box, slit, soup, together

from vto_pipeline import cloth
from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import ContactSpan
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
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
    even = {"skin_mm": 1.0, "substeps": 1}
    found = cloth.simulate(TriangleMesh(start, mesh.faces), fabric(), colliders=[plane], seconds=seconds, settings=even)
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
    model = build_cloth(mesh, RestShape(mesh.vertices), fabric(bending=1e-6))
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
    span = ContactSpan(0.0, 1.0, 0.05, np.full(200, 2e-3), 0.5)
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


TORSO, ARM, AT = (0.3, 0.6, 0.2), (0.5, 0.1, 0.1), (0.25, 0.1, 0.013)


def asked(mesh, points, job=None, skin=2e-3):
    """Distance from each contact plane [m], the point it goes through, and its normal."""
    collider = BodyCollider(MovingBody(mesh.vertices[None], mesh.faces), 0.0, 0.3, job)
    found = collider.contacts(points, ContactSpan(0.0, 1.0, 0.05, np.full(len(points), skin), 0.5))
    assert found.active.all()
    point, normal = found.point[0, :, 0], found.normal[0, :, 0]
    return np.einsum("ij,ij->i", points - point, normal), point, normal


def test_an_arm_through_the_torso_is_no_surface_inside_it():
    edge = 0.03
    mesh = together(fine_box(TORSO, edge=edge), fine_box(ARM, AT, edge=edge))
    points = np.random.default_rng(0).uniform((-0.25, -0.4, -0.2), (0.6, 0.4, 0.2), (5000, 3))
    wanted = np.minimum(from_box(points, TORSO), from_box(points, ARM, AT))
    job = Job()
    gap, point, _ = asked(mesh, points, job)
    assert "faces lie inside its other parts" in job.notes[0]
    outside = wanted > 0
    assert 300 < (~outside).sum() < 4000
    assert_allclose(gap[outside], wanted[outside], rtol=0, atol=1e-12)  # nobody outside is pulled in
    assert (gap[~outside] < 0).all()
    depth = np.minimum(from_box(point, TORSO), from_box(point, ARM, AT))
    assert (depth > -edge / 8).all()  # led to the skin of the whole; where parts meet, to within a piece of a triangle
    assert (depth > -1e-9).mean() > 0.97


def test_cloth_in_an_armpit_comes_out_of_the_body_not_into_the_torso():
    mesh = together(fine_box(TORSO), fine_box(ARM, AT))
    cloth_mesh = moved(
        sheet(9, 9, 0.06, 0.06, upright=False), 0.13, 0.143, -0.02
    )  # 7 mm under the arm's top, and in it
    stepper = stepper_on(MovingBody(mesh.vertices[None], mesh.faces), 0.0, cloth_mesh)
    found = stepper.run(at_rest(cloth_mesh.vertices), 0.5).positions
    assert (np.minimum(from_box(found, TORSO), from_box(found, ARM, AT)) > 0).all()
    assert (np.abs(found[:, 0] - 0.16) < 0.1).all()


@pytest.mark.parametrize("defect", ["soup", "doubled", "flipped", "slit", "all"])
def test_a_spoilt_body_is_as_good_as_the_clean_one(defect):
    rng, clean = np.random.default_rng(1), fine_box(TORSO, edge=0.08)
    spoilt = {
        "soup": soup,
        "doubled": lambda mesh: doubled(mesh, rng),
        "flipped": lambda mesh: flipped(mesh, rng),
        "slit": lambda mesh: slit(mesh, rng),
        "all": lambda mesh: soup(flipped(doubled(slit(mesh, rng), rng), rng)),
    }[defect](clean)
    points = rng.uniform(-0.2, 0.2, (3000, 3)) * [1, 1.8, 0.8]
    gap, point, normal = asked(spoilt, points)
    wanted = from_box(points, TORSO)
    assert 300 < (wanted < 0).sum() < 2700
    assert_allclose(gap, wanted, rtol=0, atol=1e-12)
    assert_allclose(points, point + gap[:, None] * normal, rtol=0, atol=1e-9)


def test_what_is_hidden_in_the_body_is_never_touched():
    mesh = together(fine_box(TORSO, edge=0.08), ball(0.05))
    points = np.random.default_rng(2).normal(size=(500, 3)) * 0.06
    gap, _, _ = asked(mesh, points)
    assert_allclose(gap, from_box(points, TORSO), rtol=0, atol=1e-12)


def bust():
    """A torso without a bottom."""
    whole = fine_box(TORSO, edge=0.04)
    return TriangleMesh(whole.vertices, whole.faces[whole.vertices[whole.faces].max(axis=1)[:, 1] > -0.3 + 1e-9])


def test_at_the_rim_of_an_open_body_the_winding_number_tells_inside():
    import igl

    mesh = bust()
    points = np.random.default_rng(3).uniform((-0.2, -0.36, -0.15), (0.2, -0.2, 0.15), (3000, 3))
    gap, point, _ = asked(mesh, points)
    winding = igl.winding_number(mesh.vertices, mesh.faces.astype(np.int64), points)  # every solid angle summed
    clear = np.abs(winding - 0.55) > 0.01  # the fast sum of the collider is not exact
    assert ((gap < 0) == (winding > 0.55))[clear].all()
    assert 300 < (gap < 0).sum() < 2500
    outside = gap > 0
    on = np.clip(points, [-0.15, -0.3, -0.1], [0.15, 0.3, 0.1])
    beyond = outside & (points[:, 1] < -0.3) & (on[:, [0, 2]] != points[:, [0, 2]]).any(axis=1)
    assert_allclose(gap[beyond], np.linalg.norm(points - on, axis=1)[beyond], rtol=0, atol=1e-12)  # kept off the rim
    assert (np.abs(point[:, 1]) <= 0.3 + 1e-12).all()


def test_behind_a_single_sheet_is_not_inside():
    """A fence: what hangs behind it is not cloth that came through, nor is what stands over its rim."""
    fence = moved(sheet(21, 11, 0.4, 0.2), -0.2, 0.0, 0.0)
    points = np.random.default_rng(6).uniform((-0.25, -0.25, -0.02), (0.25, 0.05, 0.02), (2000, 3))
    gap, _, normal = asked(fence, points)
    wanted = np.linalg.norm(points - np.clip(points, [-0.2, -0.2, 0], [0.2, 0, 0]), axis=1)
    assert_allclose(gap, wanted, rtol=0, atol=1e-12)
    assert (normal[:, 2] * points[:, 2] > 0).all()


def test_a_moving_body_is_looked_through_anew_when_it_comes_to_rest():
    torso, arm = fine_box(TORSO), fine_box(ARM, (0.25, 0.1, 0.3))
    before, mesh = together(torso, arm), together(torso, fine_box(ARM, AT))
    collider = BodyCollider(MovingBody(np.stack([before.vertices, mesh.vertices]), mesh.faces), 1.0, 0.3)
    points = np.random.default_rng(4).uniform((-0.25, -0.4, -0.2), (0.6, 0.4, 0.2), (2000, 3))
    wanted = np.minimum(from_box(points, TORSO), from_box(points, ARM, AT))
    for start in (0.0, 0.5, 1.0, 1.5):
        found = collider.contacts(points, ContactSpan(start, start + 0.1, 0.05, np.full(len(points), 2e-3), 0.5))
    gap = np.einsum("ij,ij->i", points - found.point[0, :, 0], found.normal[0, :, 0])
    near = found.active[0] & (wanted > 0)
    assert_allclose(gap[near], wanted[near], rtol=0, atol=1e-12)
    assert (gap[wanted < 0] < 0).all()


BODIES = Path(__file__).parents[3] / "shared" / "data" / "bodies"


@pytest.mark.real_data
@pytest.mark.skipif(not BODIES.is_dir(), reason="the real bodies are not here")
def test_nobody_outside_a_real_body_is_pulled_in():
    import igl

    from vto_pipeline.io.meshes import read_mesh

    mesh = read_mesh(BODIES / "mh_female_averageweight.ply")
    rng = np.random.default_rng(5)
    points = mesh.vertices[rng.integers(0, len(mesh.vertices), 3000)] + rng.normal(size=(3000, 3)) * 5e-3
    job = Job()
    gap, _, _ = asked(mesh, points, job)
    winding = igl.winding_number(mesh.vertices, mesh.faces.astype(np.int64), points)
    assert ((gap < 0) == (winding > 0.5)).all()
    away = np.sqrt(igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces.astype(np.int64))[0])
    assert_allclose(np.abs(gap)[gap > 0], away[gap > 0], rtol=0, atol=1e-9)
    assert (np.abs(gap) >= away - 1e-9).all()
    assert "lie inside its other parts" in job.notes[0]
