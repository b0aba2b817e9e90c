"""Ways in the plane against closed forms and dense sampling."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.numerics.planar import least_turn, longest_sq, segment_distance


def turn(a, b):
    return a[0] * b[1] - a[1] * b[0]


@pytest.mark.parametrize("seed", range(50))
def test_the_least_turn_is_the_least_of_all(seed):
    a, da, b, db = np.random.default_rng(seed).normal(size=(4, 2)) * [[1], [2], [1], [2]]
    s = np.linspace(-0.5, 0.5, 2001)[:, None]
    sampled = turn((a + s * da).T, (b + s * db).T)
    found = least_turn(tuple(a), tuple(da), tuple(b), tuple(db))
    assert found <= sampled.min() + 1e-14  # rounding
    # a parabola is less than its curvature over eight under its nearest samples
    assert found >= sampled.min() - 2 * abs(turn(da, db)) / 8 / 2000**2 - 1e-14
    assert longest_sq(tuple(a), tuple(da)) >= ((a + s * da) ** 2).sum(axis=1).max() - 1e-14


def test_a_half_turn_is_least_in_its_middle():
    assert least_turn((0.0, 0.0), (2.0, 0.0), (0.0, 0.0), (0.0, 2.0)) == 0.0  # at both ends it is one
    assert least_turn((1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 1.0)) == 0.5  # evenly from 0.5 to 1.5


@pytest.mark.parametrize(
    ("other", "wanted"),
    [
        (((0.0, 1.0), (2.0, 1.0)), 1.0),  # beside it
        (((1.0, -1.0), (1.0, 1.0)), 0.0),  # across
        (((3.0, 0.0), (5.0, 0.0)), 1.0),  # further along
        (((1.0, 0.0), (5.0, 0.0)), 0.0),  # partly on it
        (((3.0, 1.0), (3.0, 1.0)), np.sqrt(2.0)),  # a point
        (((1.0, 2.0), (1.0, 0.25)), 0.25),  # the end over its middle
    ],
)
def test_the_distance_of_segments(other, wanted):
    points = np.array([(0.0, 0.0), (2.0, 0.0), *other])
    assert_allclose(segment_distance(points, 0, 1, 2, 3), wanted, rtol=1e-15, atol=0)  # few roundings
    assert_allclose(segment_distance(points, 3, 2, 1, 0), wanted, rtol=1e-15, atol=0)


def test_the_distance_of_random_segments():
    rng = np.random.default_rng(0)
    share = np.linspace(0, 1, 101)
    for _ in range(100):
        points = rng.normal(size=(4, 2))
        one = points[0] + share[:, None] * (points[1] - points[0])
        other = points[2] + share[:, None] * (points[3] - points[2])
        sampled = np.linalg.norm(one[:, None] - other, axis=2).min()
        spacing = np.linalg.norm(points[1] - points[0]) / 100 + np.linalg.norm(points[3] - points[2]) / 100
        assert sampled - 0.5 * spacing <= segment_distance(points, 0, 1, 2, 3) <= sampled + 1e-14
