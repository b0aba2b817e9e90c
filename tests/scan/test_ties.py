"""Photos that too few points tie to the others are left out: groups with ties counted by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scan_scene import make_scene, orbit, photos

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.photos.matching.ties import LEAST_LINK, LEAST_TIES, tied_together
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.similarity import fit_similarity


def sightings(*shared):
    """Of points that are each seen by the same photos: (number of points, photos)."""
    rows, start = [], 0
    for number, viewers in shared:
        rows += [(start + k, viewer) for k in range(number) for viewer in viewers]
        start += number
    return np.array(rows).T


MANY, FEW = 2 * LEAST_TIES, LEAST_TIES - 1


@pytest.mark.parametrize(
    ("ties", "kept"),
    [
        ([(MANY, (0, 1, 2)), (MANY, (1, 2, 3))], [1, 1, 1, 1]),
        ([(MANY, (0, 1, 2)), (LEAST_TIES, (1, 2, 3))], [1, 1, 1, 1]),
        ([(MANY, (0, 1, 2)), (FEW, (1, 2, 3))], [1, 1, 1, 0]),  # one photo hangs on too few
        ([(MANY, (0, 1)), (MANY, (2, 3, 4)), (FEW, (0, 1, 2))], [0, 0, 1, 1, 1]),  # two groups: the larger stays
        ([(MANY, (0, 1, 2)), (FEW, (0, 3)), (FEW, (1, 3))], [1, 1, 1, 1]),  # few with each, enough with all together
        ([(MANY, (0, 1, 2)), (MANY, (3,))], [1, 1, 1, 0]),  # what one photo sees alone ties nothing
        ([(MANY, (0, 1)), (FEW, (1, 2)), (FEW, (2, 3)), (MANY, (3, 4)), (FEW, (4, 0))], [1, 1, 1, 1, 1]),  # a ring
    ],
)
def test_the_largest_group_that_is_tied_together_stays(ties, kept):
    point, photo = sightings(*ties)
    assert_array_equal(tied_together(point, photo, len(kept)), np.array(kept, bool))


def test_a_photo_sees_a_point_once():
    point, photo = sightings((MANY, (0, 1)), (FEW, (0, 1, 2)))
    twice = np.concatenate([point, point]), np.concatenate([photo, photo])
    assert_array_equal(tied_together(*twice, 3), [True, True, False])


@pytest.mark.parametrize(
    ("ties", "kept"),
    [
        ([(MANY, (0, 1, 2)), (MANY, (2, 3, 4)), (MANY, (0, 5, 1))], [1, 1, 1, 0, 0, 1]),  # a hinge at photo 2
        ([(MANY, (0, 1, 2)), (MANY, (2, 3, 4)), (LEAST_LINK, (1, 2, 3))], [1, 1, 1, 1, 1]),  # seen past the hinge
        ([(MANY, (0, 1, 2)), (MANY, (2, 3, 4)), (LEAST_LINK, (4, 0))], [1, 1, 1, 1, 1]),  # a ring has no hinge
        ([(MANY, (0, 1)), (MANY, (1, 2)), (MANY, (2, 3))], [0, 1, 1, 0]),  # by pairs only: each of its own size
    ],
)
def test_two_parts_that_hang_together_by_one_photo_have_no_common_scale(ties, kept):
    point, photo = sightings(*ties)
    assert_array_equal(tied_together(point, photo, len(kept)), np.array(kept, bool))


def test_no_sighting_ties_nothing():
    assert not tied_together(np.zeros(0, int), np.zeros(0, int), 3).any()


@pytest.mark.parametrize("contrast", [pytest.param(0.25, marks=pytest.mark.slow), 1.0])
def test_photos_too_far_apart_are_right_or_refused(tmp_path, contrast):
    """Twelve photos 30 degrees apart. By 13 points, or by one photo, cameras were 0.6 m and 9 m off, at 0.3 px."""
    poses, lens = orbit(12, elevations_deg=(15.0,)), Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)
    scene = make_scene(contrast=contrast)
    scene.floor[:] = 150
    shown = photos(scene, tmp_path / "photos", poses, lens, board=False)
    cameras, reason = None, ""
    try:
        cameras, _ = estimate_cameras(shown, SfmConfig(enough_features=50), Job())
    except ScanError as refusal:
        reason = refusal.problem
    if cameras is None:
        assert f"{LEAST_TIES} points" in reason
        return
    truth = poses[[int(name[:3]) for name in cameras.names], :3, 3]
    centers = cameras.world_from_cam[:, :3, 3]
    scale, transform = fit_similarity(centers, truth)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)
    assert error.max() < 0.02  # at 1 m
