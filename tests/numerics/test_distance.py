"""Nearest points of triangles and segments against exact arithmetic and ipctk."""

import ipctk
import numpy as np
import pytest
from exact_distance import exact_distance
from numba import njit
from numpy.testing import assert_allclose

from vto_pipeline.numerics.distance import (
    EDGE,
    FACE,
    VERTEX,
    barycentric_point,
    closest_on_segments,
    closest_on_triangle,
)
from vto_pipeline.numerics.vector import load


@njit
def triangle_places(points):  # (N, 4, 3): p, a, b, c -> weights, nearest points, features
    weights, nearest, feature = np.empty((len(points), 3)), np.empty((len(points), 3)), np.empty(len(points), np.int64)
    for i in range(len(points)):
        p, a, b, c = load(points[i], 0), load(points[i], 1), load(points[i], 2), load(points[i], 3)
        found, feature[i] = closest_on_triangle(p, a, b, c)
        weights[i, 0], weights[i, 1], weights[i, 2] = found
        nearest[i, 0], nearest[i, 1], nearest[i, 2] = barycentric_point(found, a, b, c)
    return weights, nearest, feature


@njit
def segment_shares(points):  # (N, 4, 3): a, b, c, d -> (N, 2)
    shares = np.empty((len(points), 2))
    for i in range(len(points)):
        a, b, c, d = load(points[i], 0), load(points[i], 1), load(points[i], 2), load(points[i], 3)
        shares[i, 0], shares[i, 1] = closest_on_segments(a, b, c, d)
    return shares


def shapes(edges):
    """Name -> points: generic, flat, nearly flat, repeated and nearly repeated points, parallel and nearly parallel."""
    rng = np.random.default_rng(3)
    yield "lattice", rng.integers(-2, 3, (300, 4, 3)).astype(float)
    generic = rng.normal(size=(200, 4, 3))
    yield from (("generic", generic), ("small", 1e-9 * generic), ("large", 1e6 * generic))
    line = rng.normal(size=(200, 1, 3)) + rng.integers(-3, 4, (200, 4, 1)) * rng.normal(size=(200, 1, 3))
    parallel = rng.normal(size=(200, 4, 3))
    first = parallel[:, 1] - parallel[:, 0] if edges else parallel[:, 2] - parallel[:, 1]
    parallel[:, 3] = (parallel[:, 2] if edges else parallel[:, 1]) + rng.integers(-2, 3, (200, 1)) * first
    for flatness in (0.0, 1e-15, 1e-11, 1e-7, 1e-3):
        for base in (line, parallel):
            yield f"flat to {flatness:g}", base + flatness * rng.normal(size=base.shape)


@pytest.mark.parametrize("edges", [False, True], ids=["triangle", "segments"])
def test_distance_is_the_exact_one(edges):
    for name, points in shapes(edges):
        exact = np.array([exact_distance(one, edges) for one in points])
        if edges:
            shares = segment_shares(points)
            assert shares.min() >= 0.0
            assert shares.max() <= 1.0
            s, t = shares.T[..., None]
            a, b, c, d = points.swapaxes(0, 1)
            found = np.linalg.norm((c - a) + t * (d - c) - s * (b - a), axis=1)
        else:
            weights, nearest, _ = triangle_places(points)
            assert weights.min() >= -1e-15  # 1 - v - w may round below zero
            assert_allclose(weights.sum(axis=1), 1.0, rtol=0, atol=1e-15)
            found = np.linalg.norm(points[:, 0] - nearest, axis=1)
        # rounding; the nearest point inside a sliver cannot be told from one of its rim, see closest_on_triangle
        atol = 1e-8 if name.startswith("flat") and not edges else 2e-15
        assert_allclose(found, exact, rtol=1e-13, atol=atol * np.abs(points).max(), err_msg=name)


def test_feature_is_the_one_with_weight():
    rng = np.random.default_rng(4)
    weights, _, features = triangle_places(rng.normal(size=(3000, 4, 3)))
    for weight, feature in zip(weights, features, strict=True):
        corners = set(np.flatnonzero(weight))
        if feature >= FACE:
            assert corners == {0, 1, 2}
        elif feature >= EDGE:
            assert corners == {feature - EDGE, (feature - EDGE + 1) % 3}
        else:
            assert corners == {feature - VERTEX}
    assert set(features) == set(range(7))


def test_distances_agree_with_ipctk():
    points = np.random.default_rng(5).normal(size=(500, 4, 3))
    _, nearest, _ = triangle_places(points)
    s, t = segment_shares(points).T[..., None]
    a, b, c, d = points.swapaxes(0, 1)
    ours = np.sum((points[:, 0] - nearest) ** 2, axis=1), np.sum((a + s * (b - a) - c - t * (d - c)) ** 2, axis=1)
    for squares, peer in zip(ours, (ipctk.point_triangle_distance, ipctk.edge_edge_distance), strict=True):
        assert_allclose(squares, [peer(*one) for one in points], rtol=1e-9, atol=1e-13)  # theirs by another formula
