"""Pictures against silhouettes and shading whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise, rasterise_depth
from vto_pipeline.render.frames import BACK, FRONT, LEFT, Frame, bounds, frame_box
from vto_pipeline.render.marks import mark_places
from vto_pipeline.render.pictures import render_picture
from vto_pipeline.render.tint import tint

RED, GREEN = (220, 40, 40), (40, 200, 60)


def ball(center=(0.0, 0.0, 0.0), radius: float = 0.5, color=RED, rings: int = 96) -> TriangleMesh:
    polar, angle = np.linspace(0, np.pi, rings + 1)[:, None], 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    xyz = np.stack([np.sin(polar) * np.sin(angle), np.cos(polar) + 0 * angle, np.sin(polar) * np.cos(angle)], -1)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    a, b = i * 2 * rings + j, i * 2 * rings + (j + 1) % (2 * rings)
    faces = np.stack([a, a + 2 * rings, b + 2 * rings, a, b + 2 * rings, b], -1).reshape(-1, 3)
    vertices = np.asarray(center) + radius * xyz.reshape(-1, 3)
    return tint(TriangleMesh(vertices, faces), color)


def card(z: float, color, half: float = 0.5) -> TriangleMesh:
    """A square facing the front."""
    vertices = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return tint(TriangleMesh(vertices, [[0, 1, 2], [0, 2, 3]]), color)


def level(things: list[TriangleMesh], azimuth: float) -> Frame:
    """All of them, seen from their own height."""
    return frame_box(*bounds(things), azimuth, 0.0)


@pytest.mark.parametrize("azimuth", [0.0, 90.0, 213.0])
def test_silhouette_of_a_sphere_is_a_disc(azimuth: float) -> None:
    box = np.full(3, -0.5), np.full(3, 0.5)
    black = ball(color=(0, 0, 0))  # whatever the light, a pixel's darkness is the share of it that is covered
    picture = render_picture([black], frame_box(*box, azimuth, 0.0), size=(240, 240), margin=0.1)
    a = np.radians(azimuth)
    half_width = 0.5 * max(abs(np.cos(a)) + abs(np.sin(a)), 1.0)  # of the turned box
    radius_px = 0.5 / half_width * 0.8 * 120
    covered = (1.0 - picture[..., 0] / 255.0).sum()
    assert_allclose(covered, np.pi * radius_px**2, rtol=0.005, err_msg="192-gon 0.02 %, four samples a pixel 0.2 %")


def test_rasterised_disc_has_its_area() -> None:
    vertices, faces = ball(radius=1.0).vertices, ball(radius=1.0).faces
    corners = (vertices * [180.0, 180.0, -180.0] + [200.0, 200.0, 0.0])[faces]
    face, _, depth = rasterise(corners, 401, 401)
    assert_allclose((face >= 0).sum(), np.pi * 180**2, rtol=0.003, err_msg="192-gon 0.02 %, pixel lattice 0.1 %")
    assert_allclose(depth[200, 200], -180.0, rtol=1e-3, err_msg="the near pole, seen through a facet")


def test_depth_of_triangles_in_any_order_is_that_of_each_plane_at_each_pixel() -> None:
    """Brute force: of all triangles that hold a pixel by their half-planes, the nearest plane; none behind the eye."""
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(-8, 48, 60), rng.uniform(-8, 40, 60), rng.uniform(1, 3, 60)])
    points[-1, 2] = 0.0
    faces = np.array([rng.choice(60, 3, replace=False) for _ in range(80)], dtype=np.int32)
    v, u = np.mgrid[:32, :40]
    nearest = np.full((32, 40), np.inf)
    for face in faces[(points[faces, 2] > 0).all(axis=1)]:
        corners = points[face]
        weights = np.linalg.solve(np.vstack([corners[:, :2].T, np.ones(3)]), np.stack([u, v, 1 + 0 * u]).reshape(3, -1))
        depth = np.where((weights >= 0).all(axis=0), corners[:, 2] @ weights, np.inf).reshape(32, 40)
        nearest = np.minimum(nearest, depth)
    found = rasterise_depth(points, faces, 40, 32)
    assert 0.3 < np.isfinite(found).mean() < 1.0
    assert_allclose(found, nearest, rtol=1e-9, err_msg="rounding")
    assert_array_equal(found, rasterise(points[faces[(points[faces, 2] > 0).all(axis=1)]], 40, 32)[2])


def test_two_triangles_of_a_square_leave_no_gap() -> None:
    corners = card(0.0, RED).vertices[card(0.0, RED).faces] * 101.3 + [100.2, 100.7, 0.0]
    face, weight, _ = rasterise(corners, 200, 200)
    inside = face[51:150, 51:150]
    assert (inside >= 0).all()
    assert_allclose(
        weight[face >= 0].sum(axis=1).clip(0, 1), weight[face >= 0].sum(axis=1), atol=1e-12, err_msg="weights"
    )


def test_the_nearer_thing_hides_the_farther() -> None:
    things = [card(-0.2, GREEN), card(0.2, RED)]
    front = render_picture(things, level(things, FRONT), size=(40, 40))[20, 20]
    back = render_picture(things, level(things, BACK), size=(40, 40))[20, 20]
    assert front[0] > front[1]
    assert back[1] > back[0]


def test_the_left_view_shows_the_persons_left() -> None:
    things = [ball((0.6, 0, 0), 0.2, GREEN), ball((-0.6, 0, 0), 0.2, RED)]
    left = render_picture(things, level(things, LEFT), size=(60, 60))[30, 30]
    assert left[1] > left[0]
    front = render_picture(things, level(things, FRONT), size=(90, 40))
    assert front[20, 75, 1] > front[20, 75, 0]  # who faces us has the left hand on our right


def test_both_sides_of_cloth_are_lit_the_inside_darker() -> None:
    outside = render_picture([card(0.0, RED)], level([card(0.0, RED)], FRONT), size=(40, 40))[20, 20, 0]
    inside = render_picture([card(0.0, RED)], level([card(0.0, RED)], BACK), size=(40, 40))[20, 20, 0]
    assert 60 < inside < outside


def test_same_bits_again() -> None:
    assert_array_equal(render_picture([ball()], size=(80, 80)), render_picture([ball()], size=(80, 80)))


def test_marks_are_closed_balls_at_their_places() -> None:
    places = np.array([[0.0, 1.0, 0.0], [0.3, 1.2, -0.1]])
    marks = mark_places(places, radius=0.01)
    per = len(marks.vertices) // 2
    for k, place in enumerate(places):
        distance = np.linalg.norm(marks.vertices[k * per : (k + 1) * per] - place, axis=1)
        assert_allclose(distance, 0.01, rtol=1e-9, err_msg="on the ball")
    a, b, c = (marks.vertices[marks.faces[:, k]] for k in range(3))
    volume = np.einsum("fd,fd->f", a, np.cross(b, c)).sum() / 6
    assert_allclose(volume, 2 * 4 / 3 * np.pi * 0.01**3, rtol=0.15, err_msg="8 by 12 facets; positive means outward")
