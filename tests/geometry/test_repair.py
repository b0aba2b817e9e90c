"""Soups and broken meshes become manifold, and every change is said."""

from __future__ import annotations

import numpy as np
import pytest
import shapes
import trimesh
from numpy.testing import assert_allclose

from vto_pipeline.errors import InputError
from vto_pipeline.geometry.remeshing.repair import RepairConfig, is_manifold, repair
from vto_pipeline.geometry.topology import boundary_loops, face_components
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh


def volume(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume


def test_an_inverted_soup_becomes_the_sphere_it_came_from():
    ball = shapes.sphere(2)
    soup = TriangleMesh(
        ball.vertices[ball.faces].reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3)[:, ::-1]
    )
    job = Job()
    mended = repair(soup, RepairConfig(), job)
    assert len(mended.vertices) == len(ball.vertices)
    assert_allclose(volume(mended), volume(ball), rtol=1e-12)  # same faces, outward again
    assert len(job.notes) == 2  # welded; turned outward


def test_faces_turned_at_random_agree_again():
    ball = shapes.sphere(2)
    faces = ball.faces.copy()
    faces[::3] = faces[::3, ::-1]
    mended = repair(TriangleMesh(ball.vertices, faces), RepairConfig(), Job())
    assert_allclose(volume(mended), volume(ball), rtol=1e-12)


@pytest.mark.parametrize("inward", [False, True])
def test_an_open_tube_comes_out_outward(inward):
    pipe = shapes.tube(30, 12)
    given = TriangleMesh(pipe.vertices, pipe.faces[:, ::-1]) if inward else pipe
    mended = repair(given, RepairConfig(), Job())
    assert_allclose(np.sort(mended.faces, axis=None), np.sort(pipe.faces, axis=None))
    outward = np.cross(*(np.diff(mended.vertices[mended.faces], axis=1).transpose(1, 0, 2)))
    assert np.all((outward * shapes.centers(mended))[:, [0, 2]].sum(axis=1) > 0.0)


def test_a_sound_mesh_is_left_as_it_is_without_a_word():
    job = Job()
    ball = shapes.sphere(2)
    mended = repair(ball, RepairConfig(), job)
    assert job.notes == []
    assert np.array_equal(mended.vertices, ball.vertices)


def test_two_boxes_that_share_an_edge_come_apart():
    box = trimesh.creation.box()
    vertices = np.vstack([box.vertices, box.vertices + np.array([1, 1, 0])])
    mended = repair(TriangleMesh(vertices, np.vstack([box.faces, box.faces + 8])), RepairConfig(), Job())
    assert is_manifold(mended)
    assert face_components(mended)[0] == 2
    assert boundary_loops(mended) == []


def test_duplicates_and_degenerate_faces_go_and_are_counted():
    ball = shapes.sphere(1)
    faces = np.vstack([ball.faces, ball.faces[:2], np.roll(ball.faces[2:3], 1, axis=1), [[5, 5, 6]]])
    job = Job()
    assert len(repair(TriangleMesh(ball.vertices, faces), RepairConfig(), job).faces) == len(ball.faces)
    assert "dropped 1 degenerate faces" in job.notes
    assert "dropped 3 duplicate faces" in job.notes


def test_a_mesh_smaller_than_the_weld_is_refused_with_a_hint_at_units():
    tiny = shapes.sphere(1, radius=1e-7)
    with pytest.raises(InputError) as caught:
        repair(tiny, RepairConfig(), Job())
    assert "unit" in caught.value.hint


def test_manifold_needs_one_fan_per_vertex():
    bow_tie = TriangleMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    assert not is_manifold(bow_tie)
    assert is_manifold(repair(bow_tie, RepairConfig(weld_mm=0), Job()))
