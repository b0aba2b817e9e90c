"""Frames placed wrongly are told by what others saw through: planes in closed form, and a scene with known cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.depth import odometry
from vto_pipeline.scan.depth.contradiction import FEWEST, STRIDE, Agreement, compare_frames, contradicted_share
from vto_pipeline.scan.depth.odometry import OdometryConfig, estimate_trajectory
from vto_pipeline.scan.depth.rgbd_frame import RgbdFrame

CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
POINTS = (CAMERA.width // STRIDE) * (CAMERA.height // STRIDE)
REACH = 0.03


def wall(away):
    """A frame that looks at a wall squarely."""
    shape = (CAMERA.height, CAMERA.width)
    depth = np.full(shape, away, np.float32)
    return RgbdFrame(CAMERA, depth, np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32))


@pytest.mark.parametrize(
    ("nearer", "told", "against"),
    [
        (1.0, 2 * POINTS, 0.0),
        (0.98, 2 * POINTS, 0.0),  # within reach: the same wall
        (0.9, POINTS, 1.0),  # all its points float before what the other saw; the other's are hidden behind it
    ],
)
def test_two_walls_from_one_place(nearer, told, against):
    found = compare_frames([wall(1.0), wall(nearer)], np.tile(np.eye(4), (2, 1, 1)), [(1, 0), (0, 1)], REACH)
    assert found == [Agreement(0, 1, told, against)]


def test_far_away_more_is_one_surface_as_noise_is_more():
    """Three metres away, the same wall may be nine times as far before itself."""
    for off, against in ((0.25, 0.0), (0.35, 1.0)):
        (found,) = compare_frames([wall(3.0 + off), wall(3.0)], np.tile(np.eye(4), (2, 1, 1)), [(0, 1)], REACH)
        assert found.against == against


def test_frames_that_look_elsewhere_tell_nothing():
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, :3, :3] = Rotation.from_rotvec([0.0, np.pi, 0.0]).as_matrix()
    assert compare_frames([wall(1.0), wall(1.0)], poses, [(0, 1)], REACH) == []
    assert_allclose(contradicted_share([], 2), 0.0, rtol=0, atol=0)  # none, exactly
    assert POINTS > FEWEST


def test_a_step_aside_leaves_what_both_see():
    """Half a picture to the right: half of each is seen by the other, and agrees."""
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = 0.5 * CAMERA.width / CAMERA.fx
    (found,) = compare_frames([wall(1.0), wall(1.0)], poses, [(0, 1)], REACH)
    assert_allclose(found.told, POINTS, rtol=0, atol=2 * CAMERA.height // STRIDE)  # a column at either edge
    assert found.against == 0.0


def test_most_of_those_that_it_is_held_to_decide():
    """Frame 3 contradicts all; the others only it."""
    pairs = [(i, j) for i in range(4) for j in range(i + 1, 4)]
    found = [Agreement(i, j, 500, 0.8 if j == 3 else 0.01) for i, j in pairs]
    assert_allclose(contradicted_share(found, 5), [0.01, 0.01, 0.01, 0.8, 0.0], rtol=0, atol=1e-12)


def given(walk, shifts):
    """The walk with poses as of a phone, some of them too high [m]."""
    rough = walk[1].copy()
    for index, shift in shifts.items():
        rough[index, 1, 3] += shift
    return replace(walk[0], world_from_cam=rough, poses_approximate=True)


@pytest.mark.parametrize("shift", [0.3, -0.15])
def test_a_frame_that_was_placed_wrongly_is_left_out(walk, shift):
    job = Job()
    found = estimate_trajectory(given(walk, {7: shift}), OdometryConfig(), job)
    good = np.arange(len(found)) != 7
    assert np.isnan(found[7]).all()
    assert np.isfinite(found[good]).all()
    a, b = (poses[good, :3, 3] - poses[good, :3, 3].mean(0) for poses in (found, walk[1]))
    assert np.linalg.norm(Rotation.align_vectors(b, a)[0].apply(a) - b, axis=1).max() < 5e-3  # steps of 280 mm
    assert any("left out 1 of 22 frames" in text and "000007" in text for text in job.warnings)


def test_frames_that_are_where_they_say_stay(walk):
    job = Job()
    assert np.isfinite(estimate_trajectory(given(walk, {}), OdometryConfig(), job)).all()
    assert not job.warnings


def test_a_path_that_does_not_hold_together_is_refused(walk):
    shifts = {index: 0.25 + 0.02 * index for index in range(0, 22, 2)}
    with pytest.raises(ScanError, match="does not hold together"):
        estimate_trajectory(given(walk, shifts), OdometryConfig(), Job())


def test_a_loop_that_frames_close_by_shape_alone_is_one(walk, monkeypatch):
    """No pair far apart in time was tracked, as of cloth without features; all the same the path holds together."""
    monkeypatch.setattr(odometry, "_close_loops", lambda *_: [])
    job = Job()
    found = estimate_trajectory(walk[0], OdometryConfig(), job)
    assert job.metrics["loop_edges"] == 0
    assert not any("loop" in text for text in job.warnings)
    a, b = (poses[:, :3, 3] - poses[:, :3, 3].mean(0) for poses in (found, walk[1]))
    assert np.linalg.norm(Rotation.align_vectors(b, a)[0].apply(a) - b, axis=1).max() < 5e-3  # steps of 280 mm
