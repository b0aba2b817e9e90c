"""Ease against the perimeters of circles and ellipses."""

from __future__ import annotations

import numpy as np
import pytest
from assess_shapes import shifted, tube
from numpy.testing import assert_allclose
from scipy.special import ellipe

from vto_pipeline.assess.ease import ease_at
from vto_pipeline.assess.zones import ease_at_levels, ease_at_openings
from vto_pipeline.geometry.topology import concatenate
from vto_pipeline.model.mesh import TriangleMesh

UP = np.array([0.0, 1.0, 0.0])


def ellipse_perimeter(a: float, b: float) -> float:
    """4 a E(1 - b²/a²), a >= b."""
    return float(4 * a * ellipe(1 - (b / a) ** 2))


def at(garment: TriangleMesh, body: TriangleMesh, height: float, rest: np.ndarray | None = None):
    return ease_at(garment, garment.vertices if rest is None else rest, body, height * UP, UP)


def test_concentric_circles() -> None:
    found = at(tube(0.17, 0.17, 0.5, 1.5), tube(0.15, 0.15, 0.0, 1.8), 1.03)
    # the slanted edges of the tube carry points of the 256-gon's sides: between inscribed polygon and circle
    assert_allclose(found.body_girth, 2 * np.pi * 0.15, rtol=2e-4, err_msg="256-gon: 1 - sinc(pi/256) = 2.5e-5")
    assert_allclose(found.ease, 2 * np.pi * 0.02, rtol=2e-4, err_msg="256-gon")
    assert found.closed


def test_ellipses() -> None:
    found = at(tube(0.22, 0.14, 0.5, 1.5), tube(0.18, 0.11, 0.0, 1.8), 1.0)
    assert_allclose(found.garment_girth, ellipse_perimeter(0.22, 0.14), rtol=2e-4, err_msg="256-gon")
    assert_allclose(
        found.ease, ellipse_perimeter(0.22, 0.14) - ellipse_perimeter(0.18, 0.11), rtol=1e-3, err_msg="256-gon"
    )


def test_girth_on_a_cone_is_that_of_the_height() -> None:
    body, garment = tube(0.15, 0.15, 0.0, 2.0), tube(0.2, 0.2, 0.5, 1.5)
    cone = TriangleMesh(body.vertices * (body.vertices[:, 1:2] * [0.5, 0, 0.5] + [0, 1, 0]), body.faces)
    found = at(garment, cone, 1.13)  # between two rings
    assert_allclose(found.body_girth, 2 * np.pi * 0.15 * 0.565, rtol=1e-3, err_msg="256-gon; slanted edges")


def test_folds_are_cloth_but_not_girth() -> None:
    garment = tube(0.18, 0.18, 0.5, 1.5)
    pleat = np.where(np.arange(256) % 2 == 0, 1.0, 0.95)
    pleated = TriangleMesh(garment.vertices * (np.tile(pleat, 9)[:, None] ** [1, 0, 1]), garment.faces)
    found = at(pleated, tube(0.15, 0.15, 0.0, 1.8), 1.0)
    step = 2 * np.pi / 256
    zigzag = 256 * np.hypot(0.18 - 0.171 * np.cos(step), 0.171 * np.sin(step))
    assert_allclose(found.garment_girth, 2 * np.pi * 0.18, rtol=1e-3, err_msg="tape over the 128 ridges")
    assert_allclose(found.cloth_length, zigzag, rtol=1e-9, err_msg="the plane passes through a ring of vertices")
    assert_allclose(found.ease, 2 * np.pi * 0.03, rtol=5e-3, err_msg="128-gon")


def test_the_tape_bridges_a_hollow() -> None:
    body = tube(0.15, 0.15, 0.0, 1.8)
    dented = body.vertices.copy()
    dented[:, 2] = np.minimum(dented[:, 2], 0.10)  # a chord across the front
    dented[(dented[:, 2] > 0.09) & (np.abs(dented[:, 0]) < 0.05), 2] = 0.02  # and a hollow in it
    half = np.arccos(0.10 / 0.15)
    expected = 0.15 * (2 * np.pi - 2 * half) + 2 * 0.15 * np.sin(half)
    found = at(tube(0.2, 0.2, 0.5, 1.5), TriangleMesh(dented, body.faces), 1.0)
    assert_allclose(found.body_girth, expected, rtol=2e-3, err_msg="the chord's ends fall between two of 256 vertices")


def test_arms_beside_the_trunk_do_not_count() -> None:
    trunk = tube(0.15, 0.12, 0.0, 1.8)
    arm = tube(0.05, 0.05, 0.6, 1.4)
    body = concatenate([trunk, shifted(arm, (0.3, 0, 0)), shifted(arm, (-0.3, 0, 0))])
    sleeve = tube(0.06, 0.06, 0.9, 1.4)
    garment = concatenate([tube(0.17, 0.14, 0.5, 1.5), shifted(sleeve, (0.3, 0, 0)), shifted(sleeve, (-0.3, 0, 0))])
    found = at(garment, body, 1.1)
    assert_allclose(
        found.ease, ellipse_perimeter(0.17, 0.14) - ellipse_perimeter(0.15, 0.12), rtol=1e-3, err_msg="256-gon"
    )


def test_sleeves_cut_away_leave_one_way_around() -> None:
    garment = tube(0.17, 0.17, 0.5, 1.5)
    centers = garment.vertices[garment.faces].mean(axis=1)
    keep = np.abs(centers[:, 0]) < 0.16  # front and back stay, two curves
    arm = tube(0.005, 0.005, 0.6, 1.4)
    body = concatenate([tube(0.15, 0.15, 0.0, 1.8), shifted(arm, (0.16, 0, 0)), shifted(arm, (-0.16, 0, 0))])
    found = ease_at(garment, garment.vertices, body, 1.0 * UP, UP, garment_faces=keep)
    half = np.arcsin(0.16 / 0.17)
    expected = 4 * half * 0.17 + 4 * 0.17 * np.cos(half)  # two arcs and two chords
    assert_allclose(found.garment_girth, expected, rtol=3e-3, err_msg="the cut follows whole faces, 4 mm wide")
    assert not found.closed


def test_loose_cloth_that_is_nearer_to_an_arm_is_no_sleeve() -> None:
    """A wide skirt with hands beside it: the arms are outside, and what hangs next to them is still the skirt."""
    arm = tube(0.04, 0.04, 0.6, 1.4)
    body = concatenate([tube(0.15, 0.12, 0.0, 1.8), shifted(arm, (0.4, 0, 0)), shifted(arm, (-0.4, 0, 0))])
    garment = tube(0.34, 0.3, 0.5, 1.5)
    keep = np.abs(garment.vertices[garment.faces].mean(axis=1)[:, 0]) < 0.25
    found = ease_at(garment, garment.vertices, body, 1.0 * UP, UP, garment_faces=keep)
    assert found.closed
    expected = ellipse_perimeter(0.34, 0.3) - ellipse_perimeter(0.15, 0.12)
    assert_allclose(found.ease, expected, rtol=2e-3, err_msg="256-gon")


def test_rest_length_and_stretch() -> None:
    garment = tube(0.17, 0.17, 0.5, 1.5)
    found = at(garment, tube(0.15, 0.15, 0.0, 1.8), 1.0, rest=garment.vertices * [0.8, 1.0, 0.8])
    assert_allclose(found.stretch, 0.25, rtol=1e-9, err_msg="the same polygon scaled by 1 / 0.8")


def test_a_garment_that_does_not_reach_has_no_ease() -> None:
    garment = tube(0.17, 0.17, 0.5, 1.0)
    body = tube(0.15, 0.15, 0.0, 1.8)
    every = np.ones(len(garment.faces), bool), np.ones(len(body.faces), bool)
    found = ease_at_levels(garment, garment.vertices, body, {"hip": 0.8, "chest": 1.3, "moon": 9.0}, *every)
    assert found["hip"] is not None
    assert found["chest"] is None
    assert found["moon"] is None


def test_openings_are_named_by_where_they_lie() -> None:
    body = tube(0.15, 0.15, 0.0, 1.8)
    garment = tube(0.17, 0.17, 0.5, 1.5)
    found = ease_at_openings(garment, garment.vertices, body)
    assert sorted(found) == ["bottom opening", "top opening"]
    for ease in found.values():
        assert_allclose(ease.ease, 2 * np.pi * 0.02, rtol=1e-3, err_msg="256-gon")


@pytest.mark.parametrize("height", [0.5 + 0.125 * k for k in range(1, 8)])
def test_a_plane_through_vertices_is_not_special(height: float) -> None:
    found = at(tube(0.17, 0.17, 0.5, 1.5), tube(0.15, 0.15, 0.0, 1.8), height)
    assert_allclose(found.ease, 2 * np.pi * 0.02, rtol=2e-4, err_msg="256-gon")
    assert found.closed
