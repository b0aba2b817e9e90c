"""What a registered body's rows come to lie on, against closed forms and brute force."""

import numpy as np
import pytest
import trimesh
from body_judges import distances
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull

from vto_pipeline.avatar.from_measurements import fit_measurements
from vto_pipeline.avatar.measuring.measuring_levels import find_levels
from vto_pipeline.avatar.scan.bust_points import toward_bust_points
from vto_pipeline.avatar.scan.misfit_correlation import morans_i
from vto_pipeline.avatar.scan.tangential_slide import slide_along_surface
from vto_pipeline.avatar.template.template import membership
from vto_pipeline.model.body import Avatar, Measurements


@pytest.fixture(scope="module")
def body() -> Avatar:
    return fit_measurements(Measurements({"stature": 1.70, "chest_girth": 0.99, "hip_girth": 1.07}, sex="female"))


def test_a_slide_keeps_to_a_ball() -> None:
    """Half an edge along a sphere: the slid vertices lie on it to a fifth of what the flat faces lie under it."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    vertices, faces = np.asarray(ball.vertices), np.asarray(ball.faces, dtype=np.int32)
    shift = np.tile([0.0, 0.5 * ball.edges_unique_length.mean(), 0.0], (len(vertices), 1))
    slid = slide_along_surface(vertices, faces, shift)
    sagitta = 0.1 - np.linalg.norm(ball.triangles_center, axis=1)
    assert np.abs(0.1 - np.linalg.norm(slid, axis=1)).max() < 0.2 * sagitta.max()
    moved = (slid - vertices)[:, 1]
    assert moved[np.abs(vertices[:, 1]) < 0.01].mean() > 0.9 * shift[0, 1]


def test_morans_i_tells_shape_from_noise() -> None:
    """On a plane: the correlation of independent noise is 0, that of a wave is the mean of its own cosine."""
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(0.0, 1.0, (10_000, 2)), np.zeros(10_000)])
    up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    noise = rng.normal(0.0, 1e-3, len(points))
    assert abs(morans_i(points, up, noise)) < 0.03  # 30,000 pairs: one part in 170 is the standard error
    wave = 1e-3 * np.sin(2 * np.pi * points[:, 0] / 0.1)
    lag = np.array([[r * np.cos(a) for r in np.linspace(0.012, 0.020, 20)] for a in np.linspace(0, np.pi, 60)])
    share = np.tile(np.linspace(0.012, 0.020, 20), (60, 1))
    expected = (np.cos(2 * np.pi * lag / 0.1) * share).sum() / share.sum()
    assert_allclose(morans_i(points, up, wave), expected, rtol=0, atol=0.03)
    assert np.isnan(morans_i(points[:1], up[:1], wave[:1]))


def test_legs_show_their_levels(body: Avatar) -> None:
    """Against brute force by trimesh: the narrowest ankle, the widest calf, the narrowest place under the knee."""
    found = find_levels(body.bind_vertices, body)
    leg = (membership("leg") > 0.2) & (body.bind_vertices[:, 0] >= 0)
    part = trimesh.Trimesh(body.bind_vertices, body.faces[leg[body.faces].all(axis=1)], process=False)

    def girth(y: float) -> float:
        cut = part.section([0, 1, 0], [0, y, 0])
        return float(ConvexHull(cut.vertices[:, [0, 2]]).area)

    def extreme(low: float, high: float, sign: float) -> float:
        heights = np.arange(low, high, 0.001)
        return float(heights[np.argmin([sign * girth(y) for y in heights])])

    calf, knee = found["calf"], found["knee"]
    floor = body.bind_vertices[:, 1].min()
    assert_allclose(found["ankle"], extreme(0.08, 0.18, 1.0), rtol=0, atol=0.006)  # the smoothing's width
    assert_allclose(calf, extreme(calf - 0.05, calf + 0.05, -1.0), rtol=0, atol=0.010)
    hollow = floor + (knee - floor) / 1.11
    assert_allclose(hollow, extreme(hollow - 0.04, hollow + 0.04, 1.0), rtol=0, atol=0.008)


def test_bust_points_come_to_the_tips(body: Avatar) -> None:
    """A bump of 5 mm on a radius of 6 mm, between the vertices: a vertex is brought there."""
    at = body.bind_vertices[body.landmarks["left_bust_point"]]
    fine = trimesh.Trimesh(body.bind_vertices, body.faces, process=False).subdivide().subdivide().subdivide()
    middle = at + np.array([0.009, 0.006, 0.0])
    away = np.linalg.norm((fine.vertices - middle)[:, :2], axis=1)
    front = fine.vertices[:, 2] > at[2] - 0.03
    fine.vertices += np.outer(front * 0.005 * np.exp(-((away / 0.006) ** 2)), [0.0, 0.0, 1.0])
    tip = fine.vertices[np.argmax(np.where(away < 0.02, fine.vertices[:, 2], -1.0))]
    shift = toward_bust_points(body.bind_vertices, np.asarray(fine.vertices), body)
    there = slide_along_surface(body.bind_vertices, body.faces, shift)[body.landmarks["left_bust_point"]]
    assert_allclose(there[:2], tip[:2], rtol=0, atol=0.003)
    assert np.linalg.norm((at - tip)[:2]) > 0.008
    assert np.abs(distances(body.bind_vertices + shift, body.bind_vertices, body.faces)).max() < 0.01
