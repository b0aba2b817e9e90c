"""Clearance between spheres about one centre is the difference of their radii."""

from __future__ import annotations

import numpy as np
from assess_shapes import sphere
from numpy.testing import assert_allclose

from vto_pipeline.assess.clearance import clearance, summarise_clearance


def test_concentric_spheres() -> None:
    outer, inner = sphere(0.25), sphere(0.2, rings=96)
    sagitta = 0.2 * (1 - np.cos(np.pi / 96))  # how far a facet of the inner one lies inside it, per direction
    assert_allclose(clearance(outer, inner).distance, 0.05, atol=3 * sagitta, rtol=0, err_msg="facets of the inner")


def test_inside_is_negative() -> None:
    found = clearance(sphere(0.18), sphere(0.2, rings=96)).distance
    assert_allclose(found, -0.02, atol=5e-4, rtol=0, err_msg="facets")


def test_summary() -> None:
    found = summarise_clearance(np.array([-0.004, 0.001, 0.01, 0.02]), np.array([1.0, 1.0, 6.0, 2.0]), 0.003)
    assert found["inside_vertices"] == 1
    assert_allclose(found["min_mm"], -4.0, rtol=1e-12, err_msg="rounding")
    assert_allclose(found["median_mm"], 10.0, rtol=1e-12, err_msg="most of the area")
    assert_allclose(found["contact_share"], 0.2, rtol=1e-12, err_msg="two of ten parts")
