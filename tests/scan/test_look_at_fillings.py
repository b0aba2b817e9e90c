"""A filling that is off by millimetres, in photos by a ray caster; the truth is the tube that they show."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scan_scene import distances, make_scene, photos
from test_rematch import PIXEL, truth_maps

from vto_pipeline.garment.openings import OpeningsConfig
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.topology import vertex_normals
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud, TriangleMesh
from vto_pipeline.scan.photos.rematch.fillings import look_at_fillings
from vto_pipeline.stages.garment import _look_at_fillings

AROUND, UP = 240, 121
OFF = 0.008
"""Of the filling, at most [m]."""


@pytest.fixture(scope="module")
def tube(scene):
    """The tube of the photos, welded where its texture begins."""
    weld = np.arange(len(scene.vertices)) % (AROUND * UP)
    return TriangleMesh(scene.vertices[: AROUND * UP], weld[scene.faces])


@pytest.fixture(scope="module")
def maps(scene, true_cameras):
    return truth_maps(scene, true_cameras)


def patch(points):
    """0 to 1, the middle of what was filled."""
    turn = np.arctan2(points[:, 0], points[:, 2])
    u, v = np.abs(turn) / np.radians(40), np.abs(points[:, 1] - 0.27) / 0.06
    return np.where((u < 1) & (v < 1), np.cos(np.pi / 2 * np.minimum(u, 1)) * np.cos(np.pi / 2 * np.minimum(v, 1)), 0.0)


@pytest.fixture(scope="module")
def wrong(tube):
    """The tube, filled wrongly; which vertices were filled."""
    share = patch(tube.vertices)
    moved = tube.vertices - OFF * np.sqrt(share)[:, None] * vertex_normals(tube)
    return TriangleMesh(moved, tube.faces), share > 0


@pytest.fixture(scope="module")
def given(shot, true_cameras, tube, maps):
    return shot[0], true_cameras, PointCloud(tube.vertices[::50]), maps


@pytest.fixture(scope="module")
def looked(wrong, given):
    return look_at_fillings(*wrong, None, *given, Job())


def test_a_filling_comes_back_to_what_the_photos_show(wrong, looked, scene):
    mesh, filled = wrong
    places, found = looked
    deep = filled & (distances(scene, mesh.vertices) > 2 * PIXEL)
    assert deep.sum() > 1000
    assert found[deep].mean() > 0.7
    off = distances(scene, places[deep & found])
    assert np.median(off) < 0.25 * PIXEL
    assert np.percentile(off, 95) < 1.0 * PIXEL
    assert np.median(distances(scene, mesh.vertices[deep])) > 2.5 * PIXEL
    assert not found[~filled].any()
    assert_array_equal(places[~found], mesh.vertices[~found])


def test_plain_cloth_stays_where_it_was_filled(wrong, given, true_cameras, tmp_path):
    plain = make_scene(contrast=0.0)
    shots = photos(plain, tmp_path, true_cameras.world_from_cam, true_cameras.intrinsics[0], board=False)
    mesh, filled = wrong
    places, found = look_at_fillings(mesh, filled, None, shots, *given[1:], Job())
    assert found[filled].mean() < 0.05
    assert_array_equal(places[~found], mesh.vertices[~found])


def test_what_something_hides_is_not_looked_for(wrong, given, tube):
    """A wider and taller tube all round: whatever the photos show, it is not what was filled."""
    middle = np.array([0.0, 0.3, 0.0])
    wall = TriangleMesh((tube.vertices - middle) * [1.4, 6.0, 1.4] + middle, tube.faces)
    places, found = look_at_fillings(*wrong, wall, *given, Job())
    assert not found.any()
    assert_array_equal(places, wrong[0].vertices)


def test_beside_a_rim_nothing_is_looked_for(tube, given):
    top = tube.vertices[:, 1].max()
    filled = (tube.vertices[:, 1] > 0.42) & (tube.vertices[:, 2] > 0.02)
    mesh = TriangleMesh(tube.vertices - 0.004 * filled[:, None] * vertex_normals(tube), tube.faces)
    _, found = look_at_fillings(mesh, filled, None, *given, Job())
    beside = tube.vertices[:, 1] > top - 4.5 * PIXEL
    assert (filled & beside).sum() > 100
    assert not found[beside].any()
    assert found[filled & (tube.vertices[:, 1] < top - 10 * PIXEL)].mean() > 0.5


def test_nothing_filled_nothing_looked_at(wrong, given):
    mesh, filled = wrong
    places, found = look_at_fillings(mesh, np.zeros_like(filled), None, *given, Job())
    assert not found.any()
    assert_array_equal(places, mesh.vertices)


def test_too_little_memory_and_it_is_left_out_in_words(wrong, given):
    job = Job(memory=1e6)
    places, found = look_at_fillings(*wrong, None, *given, job)
    assert not found.any()
    assert_array_equal(places, wrong[0].vertices)
    assert "GB of memory" in job.notes[0]


def test_the_nearest_to_what_was_seen_when_there_are_too_many(wrong, looked, given, monkeypatch):
    mesh, filled = wrong
    monkeypatch.setattr("vto_pipeline.scan.photos.rematch.fillings.MOST_PATCHES", 800)
    _, found = look_at_fillings(mesh, filled, None, *given, Job())
    away = np.min(np.linalg.norm(mesh.vertices[filled][:, None] - mesh.vertices[~filled][None, ::5], axis=2), axis=1)
    near = away <= np.quantile(away, 800 / filled.sum()) + 2 * PIXEL
    assert 100 < found.sum() <= 800
    assert not found[filled][~near].any()


def test_same_bits_on_one_core(wrong, looked, given, monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    places, found = look_at_fillings(*wrong, None, *given, Job())
    assert places.tobytes() == looked[0].tobytes()
    assert found.tobytes() == looked[1].tobytes()


def test_the_stage_looks_in_the_frame_of_the_photos(wrong, looked, given):
    """The garment stands elsewhere, turned, and a tenth larger; what is found is the same place of the photos."""
    mesh, filled = wrong
    placement = np.array([[0, 0, 1.1, 0.3], [0, 1.1, 0, -0.2], [-1.1, 0, 0, 0.1], [0, 0, 0, 1.0]])
    names = ("garment_photos", "garment_cameras", "garment_points", "garment_depth_maps")
    far = TriangleMesh([[9.0, 9, 9], [9, 9, 10], [9, 10, 9]], [[0, 1, 2]])
    inputs = dict(zip(names, given, strict=True)) | {"garment_placement": placement, "mannequin_surface": far}
    look = _look_at_fillings(inputs, OpeningsConfig(), Job())
    places, found = look(transform_mesh(mesh, placement), filled)
    assert np.mean(found == looked[1]) > 0.99
    both = found & looked[1]
    back = (places - placement[:3, 3]) @ np.linalg.inv(placement[:3, :3]).T
    assert np.median(np.linalg.norm(back - looked[0], axis=1)[both]) < 1e-4
    assert_allclose(places[~found], transform_mesh(mesh, placement).vertices[~found], atol=1e-12)


def test_without_photos_it_is_left_out_with_the_reason(given):
    job = Job()
    assert _look_at_fillings({"garment_photos": given[0]}, OpeningsConfig(), job) is None
    assert job.left_out == [("a look at what was filled", "the scan has no photos with depth")]


def test_who_does_not_want_it_gets_none_and_no_word(given):
    inputs = dict(
        zip(("garment_photos", "garment_cameras", "garment_points", "garment_depth_maps"), given, strict=True)
    )
    job = Job()
    assert _look_at_fillings(inputs, OpeningsConfig(), job) is not None
    assert _look_at_fillings(inputs, OpeningsConfig(look_again=False), job) is None
    assert _look_at_fillings({}, OpeningsConfig(look_again=False), job) is None
    assert job.left_out == []
