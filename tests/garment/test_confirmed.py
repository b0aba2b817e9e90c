"""Fillings that photos confirm: what follows them by closed form, and what may not be."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from test_openings import RADIUS, SPOTS, arm, punched, sleeve

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes, list_openings
from vto_pipeline.garment.photographed.confirmed import confirm_fillings
from vto_pipeline.geometry.intersections import self_intersections
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def sheet(height=0.0, count=61, side=0.3):
    """A flat square in even triangles, its upper side up."""
    x, z = np.meshgrid(np.linspace(-side / 2, side / 2, count), np.linspace(-side / 2, side / 2, count), indexing="ij")
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return TriangleMesh(np.column_stack([x.ravel(), np.full(count**2, height), z.ravel()]), faces)


def ball(radius, middle):
    turn, up = np.meshgrid(np.linspace(0, 2 * np.pi, 64, endpoint=False), np.linspace(-1, 1, 41)[1:-1], indexing="ij")
    turn, up = turn.ravel(), np.pi / 2 * up.ravel()
    points = np.column_stack([np.cos(up) * np.cos(turn), np.sin(up), np.cos(up) * np.sin(turn)])
    points = np.vstack([points, [[0, -1, 0], [0, 1, 0]]])
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    faces = np.array(hull.simplices)
    inward = np.einsum(
        "fd,fd->f", hull.equations[:, :3], np.cross(*(points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2)))
    )
    faces[inward < 0] = faces[inward < 0][:, ::-1]
    return TriangleMesh(points * radius + middle, faces)


def lowered(by, where):
    """A look that finds vertices within a radius of places that much lower."""

    def look(mesh, filled):
        found = filled & where(mesh.vertices)
        return mesh.vertices - by * found[:, None] * np.array([0.0, 1.0, 0.0]), found

    return look


def within(radius, x=0.0):
    return lambda points: np.hypot(points[:, 0] - x, points[:, 2]) <= radius


def test_what_is_not_confirmed_follows_as_a_harmonic_function():
    """Between two circles it is the logarithm of the radius."""
    flat = sheet()
    r = np.hypot(flat.vertices[:, 0], flat.vertices[:, 2])
    observed = r >= 0.12
    job = Job()
    moved, known = confirm_fillings(flat, observed, lowered(0.01, within(0.03)), None, 0.001, job)
    assert_array_equal(moved.vertices[observed], flat.vertices[observed])
    assert_allclose(moved.vertices[r <= 0.03, 1], -0.01, atol=1e-12)
    between = (r > 0.03) & (r < 0.12)
    expected = -0.01 * np.log(0.12 / r[between]) / np.log(4.0)
    assert_allclose(moved.vertices[between, 1], expected, atol=6e-4)
    assert_allclose(moved.vertices[:, [0, 2]], flat.vertices[:, [0, 2]], atol=1e-12)
    assert_array_equal(known, observed | (r <= 0.03))
    assert job.metrics["filled_vertices"] == (~observed).sum()
    assert job.metrics["confirmed_vertices"] == (r <= 0.03).sum()
    assert job.metrics["confirmed_moved_median_mm"] == job.metrics["confirmed_moved_p95_mm"] == 10.0


def test_nothing_found_nothing_moved():
    flat = sheet()
    observed = ~within(0.1)(flat.vertices)
    job = Job()
    moved, known = confirm_fillings(flat, observed, lowered(0.01, within(-1.0)), None, 0.001, job)
    assert_array_equal(moved.vertices, flat.vertices)
    assert_array_equal(known, observed)
    assert job.metrics["confirmed_vertices"] == 0


def test_no_filling_goes_into_the_mannequin():
    flat = sheet()
    form = ball(0.1, [0.0, -0.105, 0.0])
    distance = SurfaceDistance(form)
    observed = ~within(0.1)(flat.vertices)
    moved, known = confirm_fillings(flat, observed, lowered(0.02, within(0.06)), distance, 0.002, Job())
    away = np.linalg.norm(moved.vertices - [0.0, -0.105, 0.0], axis=1) - 0.1
    assert away.min() > 0.002 - 3e-4  # the ball is a polyhedron
    r = np.hypot(*flat.vertices[:, [0, 2]].T)
    low = (r > 0.055) & (r < 0.06)  # beside the ball's top they go down
    assert (moved.vertices[low, 1] < -0.005).all()
    assert not known[r < 0.03].any()  # what had to stay 20 mm higher is not where the photos show it
    assert known[low].any() or (np.linalg.norm(moved.vertices - flat.vertices, axis=1)[low] > 0.005).all()


def test_what_is_near_the_mannequin_already_may_stay_as_near():
    """It is raised a little, and is still nearer than fillings may be: nothing more is pushed."""
    flat = sheet()
    distance = SurfaceDistance(ball(0.1, [0.0, -0.101, 0.0]))
    observed = ~within(0.1)(flat.vertices)
    given = flat, observed, lowered(-0.0005, within(0.05))
    moved, known = confirm_fillings(*given, distance, 0.003, Job())
    free, _ = confirm_fillings(*given, None, 0.003, Job())
    assert_allclose(moved.vertices, free.vertices, atol=1e-12)
    assert known[within(0.05)(flat.vertices)].all()


def test_only_what_would_cross_other_cloth_goes_back():
    """Two layers 8 mm apart; of two fillings in the upper one, one was found below the lower."""
    upper, lower = sheet(0.0), sheet(-0.008)
    count = len(upper.vertices)
    both = TriangleMesh(np.vstack([upper.vertices, lower.vertices]), np.vstack([upper.faces, lower.faces + count]))
    filled = (within(0.05, -0.07)(both.vertices) | within(0.05, 0.07)(both.vertices)) & (np.arange(2 * count) < count)

    def look(mesh, which):
        deep, fine = which & within(0.02, -0.07)(mesh.vertices), which & within(0.02, 0.07)(mesh.vertices)
        down = 0.02 * deep + 0.005 * fine
        return mesh.vertices - down[:, None] * np.array([0.0, 1.0, 0.0]), deep | fine

    moved, known = confirm_fillings(both, ~filled, look, None, 0.001, Job())
    assert len(self_intersections(moved)) == 0
    assert moved.vertices[:count, 1].min() > -0.008
    good = np.flatnonzero(filled & within(0.02, 0.07)(both.vertices))
    assert_allclose(moved.vertices[good, 1], -0.005, atol=1e-12)
    assert known[good].all()
    assert not known[np.flatnonzero(filled & within(0.02, -0.07)(both.vertices))].any()


def test_crossings_that_were_there_hold_nothing_back():
    """A tall triangle stands across the filling, before and after."""
    flat = sheet()
    count = len(flat.vertices)
    across = np.array([[0.001, -0.5, -1.0], [0.001, -0.5, 1.0], [0.001, 1.0, 0.0]])
    both = TriangleMesh(np.vstack([flat.vertices, across]), np.vstack([flat.faces, count + np.array([[0, 1, 2]])]))
    before = len(self_intersections(both))
    filled = within(0.05)(both.vertices) & (np.arange(count + 3) < count)
    moved, known = confirm_fillings(both, ~filled, lowered(-0.004, within(0.03)), None, 0.001, Job())
    assert before > 50
    assert len(self_intersections(moved)) == before
    high = filled & within(0.03)(both.vertices)
    assert_allclose(moved.vertices[high, 1], 0.004, atol=1e-12)
    assert known[high].all()


def to_the_tube(mesh, filled):
    """What photos of the sleeve would show: all of it."""
    flat = mesh.vertices * [1, 0, 1]
    on = flat / np.linalg.norm(flat, axis=1, keepdims=True) * RADIUS + mesh.vertices * [0, 1, 0]
    return np.where(filled[:, None], on, mesh.vertices), filled


def test_confirmed_cloth_counts_as_seen():
    torn = punched(sleeve(), SPOTS, 0.055)
    strict = OpeningsConfig(least_seen=0.95)
    with pytest.raises(GarmentError, match=r"of the garment was seen"):
        close_scan_holes(torn, arm(), strict, Job())
    job = Job()
    garment, openings, observed = close_scan_holes(torn, arm(), strict, job, look=to_the_tube)
    assert observed.all()
    assert job.metrics["unobserved_share"] < 0.002  # ears between three corners that were seen
    assert_allclose(np.linalg.norm(garment.vertices * [1, 0, 1], axis=1), RADIUS, atol=2e-4)
    assert len(openings) == 2
    assert [one.perimeter for one in openings] == [one.perimeter for one in list_openings(garment)]


def test_openings_are_listed_as_they_are_after_the_look():
    """Filled notches lie on the rim; the look moves them, and with them the rim."""
    torn = punched(sleeve(), [[0.0, 0.39, 0.1], [0.1, 0.2, 0.0]], 0.03)

    def look(mesh, filled):
        up = filled & (mesh.vertices[:, 1] > 0.36)
        return mesh.vertices + 0.004 * up[:, None] * np.array([0.0, 1.0, 0.0]), up

    garment, openings, _ = close_scan_holes(torn, arm(), OpeningsConfig(), Job(), look=look)
    assert [one.perimeter for one in openings] == [one.perimeter for one in list_openings(garment)]
