"""Nearest points against libigl, which shares nothing with the tree; overlapping boxes against brute force."""

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.numerics.cpu_threads import limited_threads
from vto_pipeline.numerics.distance import EDGE, FACE, VERTEX, closest_on_triangle
from vto_pipeline.numerics.spatial import bvh
from vto_pipeline.numerics.spatial.bvh_pairs import cross_pairs, self_pairs
from vto_pipeline.numerics.spatial.morton import morton_order


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
    triangle, weights, _ = bvh.closest_triangles(tree, vertices, faces, points, np.full(count, np.inf))
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
    wanted = bvh.closest_triangles(fresh, moved, faces, points, reach)[0]
    assert_array_equal(bvh.closest_triangles(tree, moved, faces, points, reach)[0], wanted)


def test_a_guess_does_not_change_the_answer(soup):
    vertices, faces = soup
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.5, 1.5, (600, 3))
    tree = bvh.build(vertices, faces)
    plain = bvh.closest_triangles(tree, vertices, faces, points, np.full(600, np.inf))
    guess = rng.integers(-1, len(faces), 600).astype(np.int32)
    guided = bvh.closest_triangles(tree, vertices, faces, points, np.full(600, np.inf), guess)
    assert_array_equal(plain[0], guided[0])


def test_nothing_beyond_reach(soup):
    vertices, faces = soup
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (600, 3))
    distance = np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces.astype(np.int64))[0])
    triangle, _, _ = bvh.closest_triangles(bvh.build(vertices, faces), vertices, faces, points, np.full(600, 0.1))
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


def halves(count, leaves, first=0, last=None):
    """Where the places of the leaves of each inner node begin, are halved and end."""
    last = leaves if last is None else last
    if last - first > 1:
        middle = (first + last) // 2
        yield tuple(leaf * count // leaves for leaf in (first, middle, last))
        yield from halves(count, leaves, first, middle)
        yield from halves(count, leaves, middle, last)


@pytest.mark.parametrize("count", [1, 4, 5, 700])
def test_each_node_is_halved_across_the_longest_side(soup, count):
    vertices, faces = soup[0], soup[1][:count]
    order = bvh.build(vertices, faces).order
    assert_array_equal(np.sort(order), np.arange(count))
    centres = vertices[faces].mean(axis=1)
    leaves = 2 ** int(np.ceil(np.log2(np.ceil(count / 4))))
    for begin, middle, end in halves(count, leaves):
        along = centres[order[begin:end]]
        along = along[:, np.ptp(along, axis=0).argmax()]
        assert along[: middle - begin].max() <= along[middle - begin :].min()


def test_triangles_at_one_place_are_halved_by_their_number():
    vertices, faces = np.zeros((3, 3)), np.zeros((100, 3), dtype=np.int32) + np.arange(3, dtype=np.int32)
    order = bvh.build(vertices, faces).order
    for begin, middle, end in halves(100, 32):
        assert order[begin:middle].max() < order[middle:end].min()


def test_morton_order_keeps_neighbours_together():
    points = np.random.default_rng(0).uniform(0, 1, (4000, 3))
    order = morton_order(points)
    assert_array_equal(np.sort(order), np.arange(4000))
    step = np.linalg.norm(np.diff(points[order], axis=0), axis=1).mean()
    assert 0.02 < step < 0.12  # in random order it would be 0.66


def swept_tree(start, end, faces, radius):
    tree = bvh.build(start, faces)
    bvh.refit_swept(tree, start, end, faces, radius)
    return tree


def moving_soup(count, seed, size=0.1):
    """Triangles on their way, with a radius at each corner."""
    rng = np.random.default_rng(seed)
    start = (rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))).reshape(-1, 3)
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return start, start + rng.normal(0, size, start.shape), faces, rng.uniform(0, size, 3 * count)


def overlapping(one, other):
    """The pairs of triangles whose swept boxes overlap, by brute force."""
    corners = []
    for start, end, faces, radius in (one, other):
        low, high = np.minimum(start, end) - radius[:, None], np.maximum(start, end) + radius[:, None]
        corners += [low[faces].min(axis=1), high[faces].max(axis=1)]
    low, high, other_low, other_high = corners
    return np.argwhere(((low[:, None] <= other_high) & (other_low <= high[:, None])).all(axis=2))


def in_order(pairs):
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


@pytest.mark.parametrize("count", [1, 2, 5, 300, 3000])  # one leaf, two, and more and fewer than the serial limits
def test_pairs_of_one_surface(count):
    soup = moving_soup(count, 4)
    found = self_pairs(swept_tree(*soup))
    every = overlapping(soup, soup)
    assert_array_equal(in_order(np.sort(found, axis=1)), every[every[:, 0] < every[:, 1]])


@pytest.mark.parametrize("sizes", [(0.1, 0.1), (0.01, 0.5)])  # alike, and small triangles among large ones
def test_pairs_of_two_surfaces(sizes):
    one, other = moving_soup(700, 5, sizes[0]), moving_soup(400, 6, sizes[1])
    found = cross_pairs(swept_tree(*one), swept_tree(*other))
    assert_array_equal(in_order(found), overlapping(one, other))
    assert len(found) > 1000


def test_a_hub_gets_more_room_than_expected():
    start, end, faces, radius = moving_soup(600, 7, 0.01)
    start[:6] = end[:6] = np.tile([[-9.0, -9.0, -9.0], [9.0, 9.0, 9.0], [9.0, -9.0, 9.0]], (2, 1))  # hold all others
    soup = start, end, faces, radius
    every = overlapping(soup, soup)
    every = every[every[:, 0] < every[:, 1]]
    assert (every[:, 0] <= 1).sum() > 600
    assert_array_equal(in_order(np.sort(self_pairs(swept_tree(*soup)), axis=1)), every)


def test_the_boxes_are_the_same_for_any_number_of_threads():
    start, end, faces, radius = moving_soup(17_000, 8)
    tree = bvh.build(start, faces)
    nodes = []
    for threads in (1, 2):
        with limited_threads(threads):
            bvh.refit_swept(tree, start, end, faces, radius)
            nodes.append(tree.nodes.copy())
    assert_array_equal(nodes[0], nodes[1])
    low, high = np.minimum(start, end) - radius[:, None], np.maximum(start, end) + radius[:, None]
    assert_array_equal(nodes[0][0], np.concatenate([low.min(axis=0), high.max(axis=0)]))  # the root holds all


def test_a_tree_is_worn_only_when_triangles_leave_their_neighbours(soup):
    vertices, faces = soup
    tree = bvh.build(vertices, faces)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    bvh.refit_swept(tree, vertices, vertices + 5.0, faces, np.full(len(vertices), 0.3))
    assert not bvh.degraded(tree, vertices, faces)  # a long way of all is no wear
    assert not bvh.degraded(tree, 3.0 * vertices @ turn.T + 1.0, faces)
    shuffled = vertices.reshape(-1, 3, 3)[np.random.default_rng(1).permutation(len(faces))].reshape(-1, 3)
    assert bvh.degraded(tree, shuffled, faces)
    assert not bvh.degraded(bvh.build(shuffled, faces), shuffled, faces)
