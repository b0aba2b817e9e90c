"""Lengths, areas and polylines of plane curves against closed forms, scipy's quadrature and brute force."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.spatial import cKDTree

from vto_pipeline.numerics.plane_curves import at_shares, curve_area, curve_at, curve_length, flatten

CUBIC = np.array([[0.0, 0.0], [0.9, 0.1], [-0.4, 0.8], [0.5, 0.5]])
QUADRATIC = np.array([[0.1, 0.0], [0.5, 0.7], [0.6, -0.1]])
LINE = np.array([[0.0, 0.0], [0.3, 0.4], [0.3, 1.4]])
ENDS = np.array([[0.2, 0.1], [0.5, 0.5]])
CURVES = [
    ("bezier", CUBIC, 0.0),
    ("bezier", QUADRATIC, 0.0),
    ("polyline", LINE, 0.0),
    ("arc", ENDS, 0.4),
    ("arc", ENDS, -2.5),
]


def dense(curve, count=200_001):
    return curve_at(*curve, np.linspace(0.0, 1.0, count))


@pytest.mark.parametrize("bulge", [0.1, 0.41421356237, 1.0, 3.0, -0.7])
def test_an_arc_is_a_piece_of_a_circle(bulge):
    angle = 4.0 * np.arctan(abs(bulge))
    radius = 0.5 / (2.0 * np.sin(angle / 2.0))  # the chord is 0.5
    assert curve_length("arc", ENDS, bulge) == pytest.approx(abs(radius) * angle, rel=1e-12)
    points = dense(("arc", ENDS, bulge), 101)
    assert points[[0, -1]] == pytest.approx(ENDS, abs=1e-12)
    left = np.linalg.det(np.stack([ENDS[1] - ENDS[0], points[50] - ENDS[0]]))
    assert np.sign(left) == -np.sign(bulge)  # anticlockwise: the chord stays on the left
    segment = 0.5 * radius**2 * (angle - np.sin(angle))
    chord = 0.5 * (ENDS[0, 0] * ENDS[1, 1] - ENDS[1, 0] * ENDS[0, 1])
    assert curve_area("arc", ENDS, bulge) == pytest.approx(chord + np.sign(bulge) * segment, rel=1e-12)


def test_a_bezier_curve_is_as_long_as_quadrature_says():
    for points in (CUBIC, QUADRATIC):
        degree = len(points) - 1
        control = np.diff(points, axis=0) * degree

        def speed(t, control=control):
            return float(np.linalg.norm(curve_at("bezier", control, 0.0, np.array([t]))))

        assert curve_length("bezier", points, 0.0) == pytest.approx(quad(speed, 0, 1, epsabs=1e-13)[0], rel=1e-10)


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_shares_of_the_length_are_where_a_ruler_finds_them(curve):
    fine = dense(curve)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1))])
    shares = np.array([0.0, 0.1, 0.37, 0.5, 0.93, 1.0])
    expected = np.stack([np.interp(shares * run[-1], run, fine[:, k]) for k in range(2)], axis=1)
    assert np.abs(at_shares(*curve, shares) - expected).max() < 1e-6  # the ruler cuts corners
    assert curve_length(*curve) == pytest.approx(run[-1], rel=1e-6)


@pytest.mark.parametrize("curve", CURVES, ids=str)
def test_the_area_is_that_of_a_fine_polygon(curve):
    fine = dense(curve)
    x, y = fine[:-1], fine[1:]
    assert curve_area(*curve) == pytest.approx(0.5 * float((x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum()), abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(CURVES), st.floats(1e-6, 1e-2))
def test_a_flat_curve_stays_within_its_tolerance(curve, tolerance):
    flat = flatten(*curve, tolerance)
    assert (flat[[0, -1]] == curve[1][[0, -1]]).all()
    fine = dense(curve, 4001)
    ends = np.linspace(0.0, 1.0, 2000)[:, None]
    on = np.concatenate([a + ends * (b - a) for a, b in pairwise(flat)])
    spacing = np.linalg.norm(np.diff(flat, axis=0), axis=1).max() / 2000  # of the points that stand for the lines
    assert cKDTree(on).query(fine)[0].max() <= tolerance * 1.001 + spacing
    if curve[0] != "polyline" and len(flat) > 3:  # and is not much finer than asked
        assert len(flat) < 12.0 / np.sqrt(tolerance)


@pytest.mark.parametrize("bulge", [1e-300, 1e-12, -1e-6, 1e-3, 1e6])
def test_an_arc_that_is_all_but_straight_or_all_but_a_circle_is_cut_into_finitely_many(bulge):
    flat = flatten("arc", np.array([[0.0, 0.0], [1.0, 0.0]]), bulge, 1e-4)
    assert np.ptp(flat[:, 1]) == pytest.approx(0.5 * abs(bulge), rel=1e-3, abs=1e-4)  # the middle stands off by that
