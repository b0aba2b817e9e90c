"""Fillings lifted off a body: a sheet over a ball, whose every distance has a formula, and a hole over a shoulder."""

from __future__ import annotations

import dressed_form
import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.bare_parts import BareParts
from vto_pipeline.garment.lifting import KeptOutside, check_lifted, lift_fillings
from vto_pipeline.garment.openings import OpeningsConfig, close_scan_holes
from vto_pipeline.geometry.remeshing.holes import fill_holes
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import boundary_walks, submesh
from vto_pipeline.model.garment import SurfaceLabels
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh

BALL = 0.1


@pytest.fixture(scope="module")
def ball():
    made = trimesh.creation.icosphere(subdivisions=5, radius=BALL)
    return TriangleMesh(made.vertices, made.faces)


def over_a_ball(gap, hole, seed=0):
    """A dome `gap` off a ball from 100 degrees down, without what is within `hole` of its top, and a flat filling."""
    made = trimesh.creation.icosphere(subdivisions=5, radius=BALL + gap)
    from_top = np.arccos(np.clip(made.vertices[:, 1] / (BALL + gap), -1, 1))
    kept = (from_top[made.faces] > hole).all(axis=1) & (from_top[made.faces] < np.radians(100)).all(axis=1)
    torn = submesh(TriangleMesh(made.vertices, made.faces), kept)[0]
    walk = max(boundary_walks(torn), key=lambda one: torn.vertices[torn.faces[one // 3, 0], 1].mean())
    return torn, fill_holes(torn, [walk])


def area(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def away(mesh):
    return np.linalg.norm(mesh.vertices, axis=1) - BALL


@pytest.mark.parametrize("gap", [0.002, 0.006])
def test_a_filling_pressed_into_a_ball_comes_to_lie_as_far_off_as_the_cloth_around_it(ball, gap):
    """Cloth that rests on a ball all round rests on it in the hole, too: that is the truth, and it is known."""
    torn, filled = over_a_ball(gap, np.radians(60))
    new = np.arange(len(filled.vertices)) >= len(torn.vertices)
    pressed = filled.vertices.copy()
    hem = filled.vertices[:, 1] < -0.0145
    assert 0.005 < hem[~new].mean() < 0.09
    pressed[hem] *= (BALL + 0.0005) / (BALL + gap)  # far away a little of the cloth touches
    pressed[new, 1] -= 0.05 * np.cos(0.5 * np.pi * np.linalg.norm(pressed[new][:, ::2], axis=1) / (0.87 * BALL))
    sunk = TriangleMesh(pressed, filled.faces)
    assert away(sunk)[new].min() < -0.03
    _, lifted, _, moved, _ = lift_fillings(sunk, new, SurfaceDistance(ball), 0.001)
    assert_allclose(away(lifted)[new], gap, atol=0.001)  # facets of 3 mm, and of the ball itself
    assert_allclose(lifted.vertices[~new], sunk.vertices[~new], rtol=0, atol=0)
    assert moved[new].mean() > 0.8
    assert not moved[~new].any()
    corners = lifted.vertices[lifted.faces[new[lifted.faces].any(axis=1)]]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max()
    assert longest < 0.012  # those of the rim are 3.4 mm: what was pressed in is not torn apart on the way out


def blown_up(gap, by):
    """Cloth `gap` off a ball, whose filling of a wide hole rises from it to stand off by more from 4 cm on.

    Returns:
        The mesh; which vertices were filled; how far from the rim along the cloth, and by how much off it, each is [m].
    """
    torn, filled = over_a_ball(gap, np.radians(60))
    new = np.arange(len(filled.vertices)) >= len(torn.vertices)
    way = filled.vertices / np.linalg.norm(filled.vertices, axis=1, keepdims=True)
    from_rim = (np.radians(60) - np.arccos(np.clip(way[:, 1], -1, 1))) * (BALL + gap)
    rise = np.where(new, by * np.sin(0.5 * np.pi * np.clip(from_rim / 0.04, 0.0, 1.0)) ** 2, 0.0)
    blown = np.where(new[:, None], way * (BALL + gap + rise)[:, None], filled.vertices)
    return TriangleMesh(blown, filled.faces), new, from_rim, rise


def test_a_filling_that_hangs_free_stays_as_it_is(ball):
    blown, new, _, _ = blown_up(0.07, 0.05)
    _, lifted, _, moved, _ = lift_fillings(blown, new, SurfaceDistance(ball), 0.001)
    assert_allclose(lifted.vertices, blown.vertices, rtol=0, atol=0)
    assert not moved.any()


@pytest.mark.parametrize(("gap", "by"), [(0.006, 0.015), (0.012, 0.02)])
def test_a_filling_that_stands_off_is_drawn_in_where_nothing_near_was_seen(ball, gap, by):
    """The cloth lies on the ball all round at one distance: as far off is where the mannequin would have it."""
    blown, new, from_rim, rise = blown_up(gap, by)
    _, lifted, _, moved, _ = lift_fillings(blown, new, SurfaceDistance(ball), 0.001)
    off = away(lifted) - gap
    assert_allclose(off[new & (from_rim > 0.06)], 0.0, rtol=0, atol=0.001)
    beside = new & (from_rim < 0.01)  # there it goes on as it did
    assert_allclose(off[beside], rise[beside], rtol=0, atol=0.0007)
    halfway = new & (np.abs(from_rim - 0.02) < 0.002)
    assert 0.25 < off[halfway].mean() / rise[halfway].mean() < 0.7
    assert_allclose(lifted.vertices[~new], blown.vertices[~new], rtol=0, atol=0)
    assert not moved[~new].any()


def test_beside_cloth_that_is_nearer_than_usual_a_filling_may_be_so_too(ball):
    """Most of the cloth is 6 mm off; about the hole it is 2 mm off, and so is the filling's edge."""
    torn, filled = over_a_ball(0.006, np.radians(60))
    new = np.arange(len(filled.vertices)) >= len(torn.vertices)
    from_top = np.arccos(filled.vertices[:, 1] / np.linalg.norm(filled.vertices, axis=1))
    close = filled.vertices * np.where(from_top < np.radians(62), (BALL + 0.002) / (BALL + 0.006), 1.0)[:, None]
    sunk = TriangleMesh(np.where(new[:, None], 0.9 * close, close), filled.faces)
    _, lifted, *_ = lift_fillings(sunk, new, SurfaceDistance(ball), 0.001)
    assert 0.0009 < away(lifted)[new].min() < 0.0025
    assert away(lifted)[new].max() < 0.007


def test_triangles_stretched_over_a_bulge_are_split_until_they_clear_it(ball):
    """A filling of a fan of eight triangles, each as wide as the ball: its vertices are lifted, its middles are not."""
    torn, _ = over_a_ball(0.004, np.radians(75))
    walk = max(boundary_walks(torn), key=lambda one: torn.vertices[torn.faces[one // 3, 0], 1].mean())
    rim = torn.faces.reshape(-1)[walk]
    top, ring = len(torn.vertices), len(torn.vertices) + 1 + np.arange(8)
    angle = -2 * np.pi * np.arange(8) / 8
    inner = np.column_stack([0.05 * np.cos(angle), np.full(8, 0.02), 0.05 * np.sin(angle)])
    vertices = np.vstack([torn.vertices, [[0.0, 0.02, 0.0]], inner])
    around = np.arctan2(-vertices[rim, 2], vertices[rim, 0])
    nearest = ring[np.round(around / (np.pi / 4)).astype(int) % 8]
    after, beyond = np.roll(rim, -1), np.roll(nearest, -1)
    faces = [torn.faces, np.column_stack([after, rim, nearest]), np.column_stack([after, nearest, beyond])]
    faces[-1] = faces[-1][nearest != beyond]
    fan = np.column_stack([ring, np.roll(ring, -1), np.full(8, top)])
    coarse = TriangleMesh(vertices, np.vstack([*faces, fan]).astype(np.int32))
    assert len(boundary_walks(coarse)) == 1
    new = np.arange(len(vertices)) >= len(torn.vertices)
    distance = SurfaceDistance(ball)
    lifted = lift_fillings(coarse, new, distance, 0.001)
    check_lifted(lifted, distance, None)
    before, after, filled, moved, _ = lifted
    assert not filled[: len(torn.vertices)].any()
    assert filled[len(torn.vertices) :].all()
    assert_allclose(after.vertices[: len(torn.vertices)], torn.vertices, rtol=0, atol=0)
    assert (after.faces[: len(torn.faces)] == torn.faces).all()
    assert (before.faces == after.faces).all()
    assert_allclose(area(before), area(coarse), rtol=1e-12, atol=0)  # halved where they were
    assert len(boundary_walks(after)) == 1
    assert len(after.vertices) == len(moved) > len(vertices)
    middle = after.vertices[after.faces[len(torn.faces) :]].mean(axis=1)
    assert (np.linalg.norm(middle, axis=1) - BALL).min() > -0.003  # it was 25 mm inside between two that were lifted


def test_what_a_limb_goes_through_is_refused_however_it_is_lifted():
    """A disc across an arm: lifted, its triangles still span it."""
    flat = trimesh.creation.icosphere(subdivisions=4)
    top = flat.vertices[flat.faces].mean(axis=1)[:, 1] > 0
    disc = submesh(TriangleMesh(flat.vertices, flat.faces), top)[0]
    disc = TriangleMesh(disc.vertices * [0.15, 0.0, 0.15], disc.faces)
    new = np.linalg.norm(disc.vertices, axis=1) < 0.13
    arm = trimesh.creation.capsule(height=0.8, radius=0.04, count=[48, 48])
    arm.apply_transform(trimesh.transformations.rotation_matrix(np.radians(80), [1, 0, 0]))
    distance = SurfaceDistance(TriangleMesh(arm.vertices, arm.faces))
    lifted = lift_fillings(disc, new, distance, 0.001)
    with pytest.raises(GarmentError, match="runs through the mannequin"):
        check_lifted(lifted, distance, None)


@pytest.mark.parametrize("bare", [True, False])
def test_a_filling_lifted_over_what_was_seen_bare_is_refused(ball, bare):
    torn, filled = over_a_ball(0.004, np.radians(60))
    new = np.arange(len(filled.vertices)) >= len(torn.vertices)
    sunk = TriangleMesh(np.where(new[:, None], filled.vertices * 0.6, filled.vertices), filled.faces)
    distance = SurfaceDistance(ball)
    lifted = lift_fillings(sunk, new, distance, 0.001)
    top = ball.vertices[:, 1] > 0.07
    seen = submesh(ball, (top if bare else ~top)[ball.faces].all(axis=1))[0]
    labels = SurfaceLabels(np.zeros(len(seen.vertices), bool), np.ones(len(seen.vertices)))
    parts = BareParts(seen, labels, ball)
    if bare:
        with pytest.raises(GarmentError, match="seen bare"):
            check_lifted(lifted, distance, parts)
    else:
        check_lifted(lifted, distance, parts)


def test_a_shoulder_that_was_not_seen_is_filled_outside_the_form(scene):
    """The shirt is an even 2 mm off the form there: that is what the filling must find again."""
    middle = scene.shirt.vertices[scene.shirt.faces].mean(axis=1)
    spots = np.array([[0.14, 0.755, 0.0], [0.16, 0.72, 0.03]])
    torn = submesh(scene.shirt, (np.linalg.norm(middle[:, None] - spots, axis=2) > 0.05).all(axis=1))[0]
    closed, openings, observed = close_scan_holes(torn, scene.form, OpeningsConfig(), Job())
    assert len(openings) == 4
    filling = closed.vertices[~observed]
    assert len(filling) > 20
    off = np.abs(dressed_form.form_distance(filling) - dressed_form.shirt_gap(filling))
    assert np.quantile(off, 0.95) < 0.004
    assert dressed_form.form_distance(filling).min() > 0.0005


def test_points_that_wander_are_kept_off_a_ball_though_few_are_looked_up(ball):
    class Counting(SurfaceDistance):
        asked = 0

        def signed(self, points):
            Counting.asked += len(points)
            return super().signed(points)

    draw = np.random.default_rng(0)
    points = draw.normal(size=(2000, 3))
    points *= (BALL + draw.uniform(-0.01, 0.2, (2000, 1))) / np.linalg.norm(points, axis=1, keepdims=True)
    wanted, rounds = np.full(2000, 0.004), 40
    kept, steps = KeptOutside(Counting(ball), points), draw.normal(0.0, 0.002, (rounds, 2000, 3))
    for step in steps:
        moved = points + step
        points = kept.pushed(moved, wanted)
        off = np.linalg.norm(moved, axis=1)
        true = moved * (np.maximum(off, BALL + 0.004) / off)[:, None]
        assert_allclose(points, true, atol=4e-4)  # the ball has flat faces, a degree apart from its own
    assert 2000 < Counting.asked < 0.2 * rounds * 2000
