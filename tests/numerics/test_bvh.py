"""Nearest points against libigl, which shares nothing with the tree."""

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.numerics import bvh
from vto_pipeline.numerics.distance import EDGE, FACE, VERTEX, closest_on_triangle
from vto_pipeline.numerics.morton import morton_order


@pytest.fixture
def soup():
    rng = np.random.default_rng(0)
    corners = rng.uniform(-1, 1, (700, 1, 3)) + rng.normal(0, 0.1, (700, 3, 3))
    return corners.reshape(-1, 3), np.arange(2100, dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("count", [40, 2000])  # fewer and more than the serial limit
def test_agrees_with_libigl(soup, count):
    vertices, faces = soup
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (count, 3))
    tree = bvh.build(vertices, faces)
    triangle, weights, _ = bvh.closest_points(tree, vertices, faces, points, np.full(count, np.inf))
    squared, _, nearest = igl.point_mesh_squared_distance(points, vertices, faces.astype(np.int64))
    found = np.einsum("nk,nkj->nj", weights, vertices[faces[triangle]])
    assert_allclose(found, nearest, rtol=0, atol=1e-12)  # the nearest point is unique here, so only rounding differs
    assert_allclose(weights.sum(axis=1), 1.0, rtol=0, atol=1e-14)  # barycentric
    assert squared.max() > 0.01


def test_refit_answers_like_a_new_tree(soup):
    vertices, faces = soup
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (600, 3))
    reach = np.full(600, np.inf)
    tree = bvh.build(vertices, faces)
    moved = vertices @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]) + 0.3
    bvh.refit(tree, moved, faces)
    fresh = bvh.build(moved, faces)
    wanted = bvh.closest_points(fresh, moved, faces, points, reach)[0]
    assert_array_equal(bvh.closest_points(tree, moved, faces, points, reach)[0], wanted)


def test_a_guess_does_not_change_the_answer(soup):
    vertices, faces = soup
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.5, 1.5, (600, 3))
    tree = bvh.build(vertices, faces)
    plain = bvh.closest_points(tree, vertices, faces, points, np.full(600, np.inf))
    guess = rng.integers(-1, len(faces), 600).astype(np.int32)
    guided = bvh.closest_points(tree, vertices, faces, points, np.full(600, np.inf), guess)
    assert_array_equal(plain[0], guided[0])


def test_nothing_beyond_reach(soup):
    vertices, faces = soup
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (600, 3))
    distance = np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces.astype(np.int64))[0])
    triangle, _, _ = bvh.closest_points(bvh.build(vertices, faces), vertices, faces, points, np.full(600, 0.1))
    assert_array_equal(triangle >= 0, distance <= 0.1)
    assert 20 < (triangle >= 0).sum() < 580


@pytest.mark.parametrize(
    ("point", "weights", "feature"),
    [
        ((0.2, 0.3, 5.0), (0.5, 0.2, 0.3), FACE),
        ((-1.0, -1.0, 1.0), (1, 0, 0), VERTEX),
        ((2.0, -0.5, 0.0), (0, 1, 0), VERTEX + 1),
        ((-0.5, 2.0, 0.0), (0, 0, 1), VERTEX + 2),
        ((0.25, -1.0, 0.0), (0.75, 0.25, 0), EDGE),
        ((1.0, 1.0, 0.0), (0, 0.5, 0.5), EDGE + 1),
        ((-1.0, 0.25, 0.0), (0.75, 0, 0.25), EDGE + 2),
    ],
)
def test_each_region_of_the_triangle(point, weights, feature):
    found, on = closest_on_triangle(point, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert on == feature
    assert_allclose(found, weights, rtol=0, atol=1e-15)  # known by construction


def test_morton_order_keeps_neighbours_together():
    points = np.random.default_rng(0).uniform(0, 1, (4000, 3))
    order = morton_order(points)
    assert_array_equal(np.sort(order), np.arange(4000))
    step = np.linalg.norm(np.diff(points[order], axis=0), axis=1).mean()
    assert 0.02 < step < 0.12  # in random order it would be 0.66
