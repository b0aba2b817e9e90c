"""The outline of a ball, whose every ray has a formula."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.garment.outline.contour import ContourMesh
from vto_pipeline.garment.outline.edges import EdgeLevel, EdgePhoto, _gradient
from vto_pipeline.garment.outline.fit import OutlineProblem
from vto_pipeline.garment.outline.search import _followed
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.mesh import TriangleMesh

LENS = Intrinsics(400, 300, 500.0, 500.0, 120.0, 90.0)  # the ball is far from the optical axis
RADIUS = 0.1


def depth_of_rays():
    u, v = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
    return np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones(u.shape)], -1)


def past(rays, center):
    """How far each ray passes the ball's centre [m]."""
    return np.linalg.norm(np.cross(rays, center), axis=-1) / np.linalg.norm(rays, axis=-1)


@pytest.fixture(scope="module")
def ball():
    made = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    return ContourMesh(TriangleMesh(made.vertices, made.faces))


def level(center, hidden=None):
    """A light ball before a dark backdrop, its rim blurred over about a pixel."""
    rays = depth_of_rays()
    pixel = np.linalg.norm(center) / LENS.fx
    share = np.clip(0.5 + (RADIUS - past(rays, center)) / pixel, 0, 1)
    picture = np.repeat((50 + 150 * share)[..., None], 3, axis=2).astype(np.uint8)
    nothing = np.full(share.shape, np.inf, np.float32)
    return EdgeLevel(LENS, _gradient(picture), 4.0, nothing if hidden is None else hidden)


def placed(center):
    transform = np.eye(4)
    transform[:3, 3] = center
    return transform


CENTER = np.array([0.3, 0.2, 1.5])


def test_the_outline_is_where_rays_touch_the_ball(ball):
    seen = ball.contour(placed(CENTER), level(CENTER))
    rays = np.column_stack([(seen.pixel - [LENS.cx, LENS.cy]) / LENS.fx, np.ones(len(seen.depth))])
    assert_allclose(
        past(rays, CENTER), RADIUS, rtol=0, atol=4e-4
    )  # facets of 3 mm: 0.1 mm inside, zigzag as much again
    around = np.sort(np.arctan2(*(seen.pixel - seen.pixel.mean(axis=0)).T))
    assert np.diff(around).max() < 0.2  # all round
    outward = ((seen.pixel - seen.pixel.mean(axis=0)) * seen.outward).sum(axis=1)
    assert (outward > 0).all()


def test_cloth_before_or_just_behind_hides_it_and_cloth_far_behind_does_not(ball):
    rays, left = depth_of_rays(), np.arange(LENS.width) < 220
    touched = rays @ CENTER / (rays * rays).sum(axis=-1)  # depth at which a ray that touches the ball does so
    for behind, hides in ((-0.1, True), (0.01, True), (0.3, False)):
        cloth = np.where(left, touched + behind, np.inf).astype(np.float32)
        seen = ball.contour(placed(CENTER), level(CENTER, cloth))
        assert (seen.pixel[:, 0] > 221).any()
        assert (seen.pixel[:, 0] < 219).any() != hides


def test_one_step_brings_the_outline_onto_the_edges(ball):
    shift = np.array([0.003, -0.002, 0.0])
    photo = EdgePhoto("ball", np.eye(4), (level(CENTER + shift),))
    scan = np.array([[5.0, 5.0, 5.0]])  # far away: nothing is inside
    problem = OutlineProblem([ball], SurfaceDistance(ball.mesh), scan, [photo])
    found = problem.step(placed(CENTER), 0.02, (3, 4)).scan_from_form[:3, 3] - CENTER
    assert_allclose(found, shift, rtol=0, atol=4e-4)  # a seventh of a pixel


def test_a_ball_farther_off_is_followed_along_its_ray(ball):
    photo = EdgePhoto("ball", np.eye(4), (level(CENTER * 1.02),))
    problem = OutlineProblem([ball], SurfaceDistance(ball.mesh), np.array([[5.0, 5.0, 5.0]]), [photo])
    placement = placed(CENTER)
    for _ in range(5):  # each by half of the reach at the most
        placement = problem.step(placement, 0.02, (3, 4, 5)).scan_from_form
    assert_allclose(
        placement[:3, 3], CENTER * 1.02, rtol=0, atol=4e-3
    )  # 2 % farther is 0.7 px smaller: a tenth of that


def test_a_ball_of_another_size_tells_its_scale(ball):
    wide = EdgePhoto("ball", np.eye(4), (level(CENTER / 1.03),))
    problem = OutlineProblem([ball], SurfaceDistance(ball.mesh), np.array([[5.0, 5.0, 5.0]]), [wide])
    placement = placed(CENTER)
    for _ in range(3):
        placement = problem.step(placement, 0.02, (3, 4, 6)).scan_from_form
    assert_allclose(np.cbrt(np.linalg.det(placement[:3, :3])), 1.03, rtol=2e-3, atol=0)  # of 33 px: a fifteenth pixel


def test_placements_that_meet_are_followed_once(ball, monkeypatch):
    photo = EdgePhoto("ball", np.eye(4), (level(CENTER),))
    problem = OutlineProblem([ball], SurfaceDistance(ball.mesh), np.array([[5.0, 5.0, 5.0]]), [photo])
    taken, step = [], problem.step
    monkeypatch.setattr(problem, "step", lambda *args, **how: (taken.append(args[0]), step(*args, **how))[1])

    def followed(*shifts):
        taken.clear()
        starts = [placed(CENTER + np.array([shift, 0.0, 0.0])) for shift in shifts]
        return _followed(starts, problem, (3, 4), 0.06, 6, lambda _: 0.02), len(taken)

    (alone,), steps = followed(0.003)
    (found,), with_another = followed(0.003, -0.003)
    assert with_another == steps + 1 == 8  # six steps and a look; the other met it after its first
    assert_array_equal(found.scan_from_form, alone.scan_from_form)
    (best, astray), far = followed(0.2, 0.003)  # no edge is near the first
    assert far == 2 * steps
    assert_array_equal(best.scan_from_form, alone.scan_from_form)
    assert astray.support < 0.1
