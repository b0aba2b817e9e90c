"""Orientation signs against rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from vto_pipeline.geometry.predicates import orient2d, orient3d


def exact_sign(*points):
    """Sign of the determinant of the points less the last, in rationals."""
    rows = [[Fraction(x) - Fraction(y) for x, y in zip(p, points[-1], strict=True)] for p in points[:-1]]
    if len(rows) == 2:
        value = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]
    else:
        (a, b, c), (d, e, f), (g, h, i) = rows
        value = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return (value > 0) - (value < 0)


def test_points_almost_on_a_plane_get_the_sign_of_rationals():
    rng = np.random.default_rng(1)
    signs = []
    for _ in range(400):
        a, b, c = rng.normal(size=(3, 3))
        weights = rng.dirichlet(np.ones(3))
        d = weights @ np.stack([a, b, c]) + rng.integers(-1, 2) * 1e-16
        signs.append(exact_sign(a, b, c, d))
        assert orient3d(a, b, c, d) == signs[-1]
    assert min(signs.count(-1), signs.count(1)) > 50  # both sides were met


def test_exactly_coplanar_points_are_zero():
    rng = np.random.default_rng(2)
    for _ in range(100):
        x = rng.integers(-(2**20), 2**20, (4, 2)) / 1024.0
        points = np.column_stack([x, 3.0 * x[:, 0] - 2.0 * x[:, 1] + 0.125])  # exact in binary
        assert orient3d(*points) == 0


def test_points_almost_on_a_line_get_the_sign_of_rationals():
    rng = np.random.default_rng(3)
    signs = []
    for _ in range(400):
        a, b = rng.normal(size=(2, 2))
        c = a + rng.random() * (b - a)
        signs.append(exact_sign(a, b, c))
        assert orient2d(*a, *b, *c) == signs[-1]
    assert min(signs.count(-1), signs.count(1)) > 50
