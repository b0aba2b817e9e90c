"""Rims that photos show, on tubes whose rims and views are known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_blame import ring, tube

from vto_pipeline.bench.scan.shown_rims import shown_rims
from vto_pipeline.geometry.topology import concatenate
from vto_pipeline.model.mesh import TriangleMesh

FORM = tube(0.1)
RIM = 1e3 * 180 * 0.4 * np.sin(np.pi / 180)  # of 180 edges [mm]
ROUND = ring(36)


def moved(mesh, up):
    return TriangleMesh(mesh.vertices + np.array([0.0, up, 0.0]), mesh.faces)


def kept(mesh, which):
    return TriangleMesh(mesh.vertices, mesh.faces[which(mesh.vertices[mesh.faces].mean(axis=1))])


def test_a_true_garment_has_all_its_rims_and_no_other():
    found = shown_rims(tube(), tube(), FORM, ROUND)
    assert_allclose(found["shown_rim_mm"], 2 * RIM, rtol=1e-9, atol=0)  # both circles, as they are cut in edges
    assert (found["rim_found_percent"], found["rim_false_percent"]) == (100.0, 0.0)


@pytest.mark.parametrize("gap", [0.0, 0.001])
def test_a_seam_between_panels_is_no_rim(gap):
    """The tube in two halves: the same vertices, or so far apart."""
    halves = concatenate([kept(tube(), lambda m: m[:, 1] < 0.3), moved(kept(tube(), lambda m: m[:, 1] > 0.3), gap)])
    found = shown_rims(tube(), halves, FORM, ROUND)
    assert_allclose(found["shown_rim_mm"], 2 * RIM, rtol=1e-9, atol=0)  # the same two circles
    assert found["rim_false_percent"] == 0.0


def test_rims_under_and_on_other_cloth_are_not_asked_for():
    """A narrower tube that ends within the wider one, 10 mm under it: the wider one's lower rim lies on it."""
    both = concatenate([moved(tube(0.19), -0.3), tube()])
    found = shown_rims(both, both, FORM, ROUND)
    assert_allclose(found["shown_rim_mm"], RIM * (1.0 + 0.19 / 0.2), rtol=1e-9, atol=0)  # the ends that are left
    assert found["rim_found_percent"] == 100.0
    on_it = 100.0 / (2.0 * (1.0 + 0.19 / 0.2))  # the wider one's lower rim; that under it is true, if hidden
    assert_allclose(found["rim_false_percent"], on_it, rtol=1e-9, atol=0)  # shares of the same circles


def test_photos_of_one_side_show_what_they_see_of_a_rim():
    assert shown_rims(tube(), tube(), FORM, ring(1))["shown_rim_mm"] == 0.0  # three photos are needed
    assert shown_rims(tube(), tube(), FORM, ring(1))["rim_found_percent"] is None
    cameras = ring(360)
    front = type(cameras)(cameras.names[:3], cameras.intrinsics[:3], cameras.world_from_cam[[359, 0, 1]])
    steepest = np.arccos(0.17)  # the slant at which a photo shows nothing; seen from 1.5 m off the axis, 0.3 m lower
    turn = np.linspace(0.0, np.pi, 100_000)
    way = np.stack([0.2 * np.sin(turn), 0.3 + 0 * turn, 0.2 * np.cos(turn) - 1.5])
    cosine = -(way[0] * np.sin(turn) + way[2] * np.cos(turn)) / np.linalg.norm(way, axis=0)
    half = turn[np.flatnonzero(cosine > np.cos(steepest))[-1]] - np.radians(1.0)  # all three photos
    found = shown_rims(tube(), tube(), FORM, front)
    assert_allclose(found["shown_rim_mm"], 2 * RIM * half / np.pi, rtol=0, atol=2 * 4 * 7.0)  # an edge is 7 mm


def test_a_hole_left_open_is_false_and_a_rim_elsewhere_is_not_found():
    hole = kept(tube(), lambda m: (np.abs(m[:, 0]) > 0.05) | (np.abs(m[:, 1] - 0.3) > 0.05) | (m[:, 2] < 0))
    found = shown_rims(hole, tube(), FORM, ROUND)
    assert found["rim_found_percent"] == 100.0
    assert_allclose(found["rim_false_percent"], 100.0 * 400.0 / (400.0 + 2 * RIM), rtol=0, atol=1.5)  # edges slant
    found = shown_rims(moved(tube(), 0.012), tube(), FORM, ROUND)
    assert (found["rim_found_percent"], found["rim_false_percent"]) == (0.0, 100.0)
    found = shown_rims(moved(tube(), 0.008), tube(), FORM, ROUND)
    assert (found["rim_found_percent"], found["rim_false_percent"]) == (100.0, 0.0)
