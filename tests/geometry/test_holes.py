"""Fillings against the sphere they were cut from, and triangulations against all there are."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
from numpy.testing import assert_allclose, assert_array_equal

from vto_pipeline.errors import GarmentError
from vto_pipeline.geometry.remeshing.holes import fill_holes, fill_notch
from vto_pipeline.geometry.remeshing.remesh import edge_lengths
from vto_pipeline.geometry.remeshing.repair import is_manifold
from vto_pipeline.geometry.remeshing.triangulate import triangulate_loop
from vto_pipeline.geometry.topology import boundary_loops, boundary_walks, face_normals, submesh
from vto_pipeline.model.mesh import TriangleMesh


def ball_with_hole(subdivisions, angle):
    ball = shapes.sphere(subdivisions, radius=0.15)
    return submesh(ball, shapes.centers(ball)[:, 1] < 0.15 * np.cos(angle))[0]


def test_a_filled_sphere_is_round_and_rounder_the_smaller_the_hole():
    worst = []
    for angle in (0.4, 0.2):
        cut = ball_with_hole(5, angle)
        filled = fill_holes(cut, boundary_walks(cut))
        assert boundary_loops(filled) == []
        assert is_manifold(filled)
        assert_array_equal(filled.vertices[: len(cut.vertices)], cut.vertices)
        assert_array_equal(filled.faces[: len(cut.faces)], cut.faces)
        new = slice(len(cut.faces), None)
        outward = np.einsum("fd,fd->f", face_normals(filled)[new], shapes.centers(filled)[new]) / 0.15
        assert outward.min() > 0.9
        worst.append(np.abs(np.linalg.norm(filled.vertices[len(cut.vertices) :], axis=1) - 0.15).max())
    assert 1e-7 < worst[1] < 1e-4  # a 30 mm hole within 0.1 mm
    assert worst[0] > 4.0 * worst[1]  # error grows with the fourth power of the hole in theory


def test_a_filling_is_as_fine_as_its_rim():
    cut = ball_with_hole(5, 0.4)
    filled = fill_holes(cut, boundary_walks(cut))
    patch = submesh(filled, np.arange(len(filled.faces)) >= len(cut.faces))[0]
    assert_allclose(np.median(edge_lengths(patch)), np.median(edge_lengths(cut)), rtol=0.2)


def test_several_holes_are_filled_at_once_and_the_others_stay():
    pipe = shapes.tube(90, 60, wave=0.0)
    middle = shapes.centers(pipe)
    spots = [[0.15, 0.3, 0.0], [-0.15, 0.2, 0.0], [0.0, 0.4, 0.15]]
    drop = np.any([np.linalg.norm(middle - spot, axis=1) < 0.035 for spot in spots], axis=0)
    cut, _ = submesh(pipe, ~drop)
    walks = sorted(boundary_walks(cut), key=len)
    filled = fill_holes(cut, walks[:3])
    assert sorted(map(len, boundary_loops(filled))) == sorted(map(len, walks[3:]))
    new = filled.vertices[len(cut.vertices) :]
    assert_allclose(np.hypot(new[:, 0], new[:, 2]), 0.15, atol=4e-4)  # 70 mm holes in a 150 mm tube


def test_colours_go_on_over_a_filling():
    cut = ball_with_hole(4, 0.3)
    red = TriangleMesh(cut.vertices, cut.faces, np.tile(np.uint8([200, 30, 40]), (len(cut.vertices), 1)))
    filled = fill_holes(red, boundary_walks(red))
    assert_array_equal(filled.colors, np.tile([200, 30, 40], (len(filled.vertices), 1)))


def test_a_bay_is_filled_up_to_its_mouth():
    sheet = shapes.grid(20, 20, 0.01)
    middle = shapes.centers(sheet)
    bay, _ = submesh(sheet, ~((np.abs(middle[:, 0] - 0.1) < 0.03) & (middle[:, 1] > 0.15)))
    (walk,) = boundary_walks(bay)
    start = bay.vertices[bay.faces.reshape(-1)[walk]]  # half-edge 3f+k starts at corner k of face f
    inner = (np.abs(start[:, 0] - 0.1) < 0.0301) & (start[:, 1] > 0.1499)
    first = np.flatnonzero(inner & ~np.roll(inner, 1))[0]
    shore = np.roll(walk, -first)[: inner.sum() - 1]
    mouth = np.column_stack([np.linspace(0.13, 0.07, 7)[1:-1], np.full(5, 0.2), np.zeros(5)])
    filled = fill_notch(bay, shore, mouth)
    (loop,) = boundary_loops(filled)
    assert len(loop) == 80
    area = (
        np.linalg.norm(np.cross(*np.diff(filled.vertices[filled.faces], axis=1).transpose(1, 0, 2)), axis=1).sum() / 2
    )
    assert_allclose(area, 0.04, rtol=1e-9)  # the whole sheet again, flat
    assert np.all(face_normals(filled)[:, 2] > 0.999)


@pytest.mark.parametrize("seed", range(5))
def test_a_flat_star_is_covered_just_once(seed):
    """Any overlap or fold of a flat loop's triangles would add to their area."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = rng.uniform(0.2, 1.0, (40, 1)) * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    faces = triangulate_loop(points, np.tile([0.0, 0.0, 1.0], (40, 1)), np.zeros((40, 40), dtype=bool))
    twice = np.cross(*np.diff(points[faces], axis=1).transpose(1, 0, 2))[:, 2]
    wanted = np.cross(points, np.roll(points, -1, axis=0))[:, 2].sum()
    assert_allclose(np.abs(twice).sum(), wanted, rtol=1e-12)
    assert twice.min() > 0.0


def test_a_forbidden_chord_is_not_used():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
    rim = np.tile([0.0, 0.0, 1.0], (4, 1))
    for banned, other in (((0, 2), (1, 3)), ((1, 3), (0, 2))):
        forbidden = np.zeros((4, 4), dtype=bool)
        forbidden[banned] = forbidden[banned[::-1]] = True
        for face in triangulate_loop(square, rim, forbidden):
            assert set(other) <= set(face.tolist())


def test_a_loop_that_allows_no_chord_is_refused():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    with pytest.raises(GarmentError, match="cannot be filled"):
        triangulate_loop(square, np.zeros((4, 3)), np.ones((4, 4), dtype=bool))
