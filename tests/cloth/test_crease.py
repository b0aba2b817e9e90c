"""Cloth in a crease of a body: both flanks hold it, and it comes to rest between them."""

import numpy as np
import pytest
from cloth_scenes import fabric
from numpy.testing import assert_allclose

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.cloth.collision.contacts import ContactSpan
from vto_pipeline.cloth.dynamics.stepper import StepConfig, Stepper
from vto_pipeline.cloth.model.build import at_rest, build_cloth
from vto_pipeline.cloth.outfit.combined_cloth import MultiFrictionBody
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import RestShape
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

SKIN = 2e-3


def groove(angle, columns=24):
    """A roof upside down, its flanks at this angle to each other, open along z; closed underneath."""
    half = 0.5 * angle
    across = np.array([[-np.sin(half), np.cos(half)], [0.0, 0.0], [np.sin(half), np.cos(half)]]) * 0.2
    profile = np.vstack([across, [[0.3, -0.1], [-0.3, -0.1]]])
    z = np.linspace(-0.15, 0.15, columns)
    count = len(profile)
    points = np.vstack([np.column_stack([profile, np.full(count, depth)]) for depth in z])
    faces = []
    for ring in range(columns - 1):
        for k in range(count):
            a, b = ring * count + k, ring * count + (k + 1) % count
            faces += [[a, b + count, b], [a, a + count, b + count]]
    last = (columns - 1) * count
    for k, one, other in ((0, 1, 4), (1, 3, 4), (1, 2, 3)):
        faces += [[k, one, other], [last + k, last + other, last + one]]
    return TriangleMesh(points, np.array(faces, dtype=np.int32))


def strip_over(width=0.06, length=0.16, cells=6):
    """A strip that runs along the groove, flat, above it."""
    x, z = np.linspace(-width / 2, width / 2, cells + 1), np.linspace(-length / 2, length / 2, 2 * cells + 1)
    points = np.array([[a, 0.0, b] for b in z for a in x])
    row = cells + 1
    quads = [
        (r * row + c, r * row + c + 1, (r + 1) * row + c + 1, (r + 1) * row + c)
        for r in range(2 * cells)
        for c in range(cells)
    ]
    faces = [f for a, b, c, d in quads for f in ((a, d, c), (a, c, b))]
    return TriangleMesh(points, np.array(faces, dtype=np.int32))


@pytest.mark.parametrize("degrees", [80.0, 110.0])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_strip_pulled_into_a_groove_comes_to_rest(degrees, friction):
    body, flat = groove(np.radians(degrees)), strip_over()
    model = build_cloth(flat, RestShape(flat.vertices), fabric(bending=1e-7))
    start = flat.vertices + np.array([0.004, 0.05, 0.0])
    collider = BodyCollider(MovingBody(body.vertices[None], body.faces), 0.0, friction)
    config = StepConfig(solver="newton", substeps=0.5)
    stepper = Stepper(model, [collider], np.full(len(start), SKIN), config, damping=5.0)
    state = stepper.run(at_rest(start), 4.0)
    moved = stepper.run(state, 0.2).positions - state.positions
    assert np.abs(moved).max() < 2e-5
    assert stepper.residual(state) < 0.01
    away = SurfaceDistance(body).signed(state.positions).distance
    assert away.min() > SKIN - 2e-5
    # a point that keeps its distance from both flanks lies at skin / sin(half the angle) over the edge
    assert state.positions[:, 1].min() > SKIN / np.sin(np.radians(degrees) / 2) - 1e-4


def flanks(body, points, rounds):
    """Planes of both flanks after points have been brought there in so many rounds along x."""
    collider = BodyCollider(MovingBody(body.vertices[None], body.faces), 0.0, 0.3)
    for shift in np.linspace(-0.003, 0.0, rounds):
        here = points + np.array([shift, 0.0, 0.0])
        span = ContactSpan(0.0, 1 / 60, 5e-3, np.full(len(points), SKIN), 0.5)
        found = collider.contacts(here, span)
    return found


def test_both_flanks_are_where_brute_force_finds_them():
    angle = np.radians(90.0)
    body = groove(angle)
    rng = np.random.default_rng(4)
    points = np.column_stack(
        [rng.uniform(0.0003, 0.0008, 20), rng.uniform(0.0028, 0.0033, 20), rng.uniform(-0.1, 0.1, 20)]
    )
    found = flanks(body, points, 9)
    assert found.active.shape == (2, 20)
    assert found.active.all()
    left, right = np.array([1.0, 1.0, 0.0]) / np.sqrt(2), np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    # the points came from the left, so the left flank is the first
    assert_allclose(found.normal[0, :, 0], np.tile(left, (20, 1)), rtol=0, atol=1e-9)
    assert_allclose(found.normal[1, :, 0], np.tile(right, (20, 1)), rtol=0, atol=1e-9)
    for plane, normal in ((0, left), (1, right)):
        there = np.einsum("ij,ij->i", points - found.point[plane, :, 0], found.normal[plane, :, 0])
        assert_allclose(there, points @ normal, rtol=0, atol=1e-9)


def test_what_bulges_has_one_plane():
    """What has come round a rod of eight sides, past one of them, is not held by that one, whose edge is near."""
    turn, side = np.pi / 4.0, 0.002
    ring = np.arange(8)
    circle = 0.5 * side / np.sin(0.5 * turn) * np.column_stack([np.cos(turn * ring), 0 * ring, np.sin(turn * ring)])
    half, after = np.array([0.0, 0.1, 0.0]), (ring + 1) % 8
    low, high = np.column_stack([ring, ring + 8, after]), np.column_stack([ring + 8, after + 8, after])
    rod = TriangleMesh(np.vstack([circle - half, circle + half]), np.vstack([low, high]).astype(np.int32))
    middle = 0.5 * side / np.tan(0.5 * turn)
    collider = BodyCollider(MovingBody(rod.vertices[None], rod.faces), 0.0, 0.3)
    span = ContactSpan(0.0, 1 / 60, 5e-3, np.full(5, SKIN), 0.5)
    for number, along in ((0, 0.0), (2, -0.45 * side)):
        angle = (number + 0.5) * turn
        out, round_it = np.array([np.cos(angle), 0.0, np.sin(angle)]), np.array([-np.sin(angle), 0.0, np.cos(angle)])
        place = (middle + 0.0005) * out + along * round_it
        points = place + np.linspace(-0.08, 0.08, 5)[:, None] * np.array([0.0, 1.0, 0.0])
        found = collider.contacts(points, span)
    assert found.active.sum() == 5


def test_what_was_touched_is_remembered_when_the_nearest_flank_changes():
    body = groove(np.radians(90.0))
    point = np.array([[0.0002, 0.0035, 0.0]])
    collider = BodyCollider(MovingBody(body.vertices[None], body.faces), 0.0, 0.3)
    span = ContactSpan(0.0, 1 / 60, 5e-3, np.full(1, SKIN), 0.5)
    first = []
    for x in (-0.0005, 0.0005, -0.0005, 0.0005):
        found = collider.contacts(point + np.array([x, 0.0, 0.0]), span)
        first.append(found.normal[0, 0, 0])
    assert_allclose(first, np.tile(first[0], (4, 1)), rtol=0, atol=1e-9)


def test_fabrics_of_different_friction_have_both_flanks():
    body = groove(np.radians(90.0))
    points = np.array([[0.0005, 0.003, 0.0], [0.0005, 0.003, 0.05], [0.0005, 0.003, -0.05]])
    worn = MultiFrictionBody(body, np.array([0.2, 0.5, 0.2]), Job())
    alone = BodyCollider(MovingBody(body.vertices[None], body.faces), 0.0, 0.3)
    for shift in np.linspace(-0.003, 0.0, 9):
        span = ContactSpan(0.0, 1 / 60, 5e-3, np.full(3, SKIN), 0.5)
        here = points + np.array([shift, 0.0, 0.0])
        found, wanted = worn.contacts(here, span), alone.contacts(here, span)
    assert wanted.active.sum() == 6
    for vertex, friction in enumerate([0.2, 0.5, 0.2]):
        planes = np.flatnonzero(found.active[:, vertex])
        assert_allclose(found.friction[planes], [friction, friction], rtol=0, atol=0)
        assert_allclose(found.normal[planes, vertex], wanted.normal[:, vertex], rtol=0, atol=0)
        assert_allclose(found.point[planes, vertex], wanted.point[:, vertex], rtol=0, atol=0)
        assert_allclose(found.offset[planes, vertex], wanted.offset[:, vertex], rtol=0, atol=0)
