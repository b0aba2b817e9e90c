from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scan_scene import depth_frames
from scipy.spatial.transform import Rotation

from vto_pipeline.errors import ScanError
from vto_pipeline.io.captures.cameras import read_trajectory, write_trajectory
from vto_pipeline.io.captures.depth import read_depth
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.job import Job
from vto_pipeline.scan.depth.odometry import OdometryConfig, estimate_trajectory
from vto_pipeline.scan.depth.rgbd_alignment import align_frames
from vto_pipeline.scan.depth.rgbd_frame import prepare_frame
from vto_pipeline.scan.fuse import FuseConfig, fuse_depth_frames
from vto_pipeline.scan.photos.consistency import rays


@pytest.fixture(scope="module")
def path(walk):
    job = Job()
    return estimate_trajectory(walk[0], OdometryConfig(), job), job


def test_path_is_the_one_walked(path, walk):
    found, job = path
    aligned = walk[1][0] @ np.linalg.inv(found[0]) @ found
    error = np.linalg.norm(aligned[:, :3, 3] - walk[1][:, :3, 3], axis=1)
    assert 1e-5 < np.sqrt((error**2).mean()) < 3e-3  # steps of 280 mm, noise of 1 mm
    assert job.metrics["loop_edges"] > 0
    assert not any("loop" in text for text in job.warnings)


def test_path_is_upright_with_the_first_frame_in_front(path):
    found, _ = path
    assert found[0, 2, 3] > 5 * abs(found[0, 0, 3])
    assert np.abs(found[:, 1, 0]).max() < 0.05  # no roll: the cameras' x axes are level


def test_two_runs_give_the_same_bits(path, walk):
    again = estimate_trajectory(walk[0], OdometryConfig(), Job())
    assert again.tobytes() == path[0].tobytes()


def test_given_poses_are_kept(walk):
    job = Job()
    frames = replace(walk[0], world_from_cam=walk[1])
    assert_allclose(estimate_trajectory(frames, OdometryConfig(), job), walk[1], rtol=0, atol=0)  # not touched
    assert job.left_out[0][0] == "odometry"


def test_a_phones_poses_are_refined(walk):
    """Off by 4 mm and 0.2 degrees at random; refined, by a third of it."""
    random = np.random.default_rng(1)
    rough = walk[1].copy()
    rough[:, :3, 3] += random.normal(0, 0.004, (len(rough), 3))
    turn = Rotation.from_rotvec(random.normal(0, 0.0035, (len(rough), 3))).as_matrix()
    rough[:, :3, :3] = turn @ rough[:, :3, :3]
    job = Job()
    found = estimate_trajectory(replace(walk[0], world_from_cam=rough, poses_approximate=True), OdometryConfig(), job)
    error = [np.linalg.norm(off) for off in (centred(rough, walk[1]), centred(found, walk[1]))]
    assert error[1] < 0.35 * error[0]
    assert job.metrics["refined_by_mm"] > 1


def centred(poses, truth):
    """Camera centres less the true ones, after a rigid fit (Kabsch 1976)."""
    a, b = poses[:, :3, 3] - poses[:, :3, 3].mean(0), truth[:, :3, 3] - truth[:, :3, 3].mean(0)
    return Rotation.align_vectors(b, a)[0].apply(a) - b


def test_alignment_recovers_a_small_motion_exactly_enough(walk):
    """One frame against itself, from a start that is off."""
    frames = walk[0]
    color, depth = read_image(frames.color_paths[0]), read_depth(frames.depth_paths[0], 1000.0)
    frame = prepare_frame(color, depth, frames.intrinsics)
    start = np.eye(4)
    start[:3, :3], start[:3, 3] = Rotation.from_rotvec([0.01, -0.01, 0.005]).as_matrix(), [0.004, -0.006, 0.008]
    found = align_frames(frame, frame, start, 0.03)
    assert_allclose(
        found.target_from_source, np.eye(4), rtol=0, atol=3e-4
    )  # readings are noisier than the smooth normals
    assert found.overlap > 0.8
    assert (np.linalg.eigvalsh(found.information) > 0).all()


def test_information_is_that_of_the_points_positions(walk):
    """JᵀJ of x -> (I + [w]) x + t over the fitting points, by brute force."""
    frames = walk[0]
    depth = read_depth(frames.depth_paths[0], 1000.0)
    frame = prepare_frame(None, depth, frames.intrinsics)
    found = align_frames(frame, frame, np.eye(4), 1e-9)
    inside = frame.depth > 0
    inside[-1], inside[:, -1] = False, False
    points = (rays(frame.camera.matrix, *frame.depth.shape) * frame.depth[..., None])[inside]
    skew = np.zeros((len(points), 3, 3))
    skew[:, [0, 1, 2], [1, 2, 0]], skew[:, [1, 2, 0], [0, 1, 2]] = -points[:, [2, 0, 1]], points[:, [2, 0, 1]]
    jacobian = np.concatenate([-skew, np.tile(np.eye(3), (len(points), 1, 1))], axis=2)
    truth = np.einsum("nij,nik->jk", jacobian, jacobian)
    assert_allclose(found.information, truth, rtol=1e-6, atol=1e-6 * np.abs(truth).max())  # sums in another order


def with_blanks(walk, tmp_path, *which, reading=0):
    """The first five frames, some without a reading, or with the same one everywhere [mm]."""
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((240, 320), reading, np.uint16))
    depth = tuple(blank if k in which else path for k, path in enumerate(walk[0].depth_paths[:5]))
    return replace(walk[0], depth_paths=depth, color_paths=walk[0].color_paths[:5])


@pytest.mark.parametrize("approximate", [False, True])
@pytest.mark.parametrize("blank", [0, 2])
def test_an_empty_frame_is_left_out(walk, tmp_path, blank, approximate):
    frames = with_blanks(walk, tmp_path, blank)
    if approximate:
        frames = replace(frames, world_from_cam=walk[1][:5], poses_approximate=True)
    job = Job()
    found = estimate_trajectory(frames, OdometryConfig(), job)
    if not approximate:  # otherwise its pose is known all the same
        assert np.isnan(found[blank]).all()
        assert any("left out 1 of 5 frames" in text and "blank.png" in text for text in job.warnings)
    good = [k for k in range(5) if k != blank]
    assert np.linalg.norm(centred(found[good], walk[1][good]), axis=1).max() < 5e-3  # steps of 280 mm
    write_trajectory(tmp_path / "trajectory.json", found)
    assert_array_equal(read_trajectory(tmp_path / "trajectory.json"), found)
    surface = fuse_depth_frames(frames, found, FuseConfig(voxel_mm=6), Job())
    assert len(surface.faces) > 5000


def test_too_many_empty_frames_are_refused(walk, tmp_path):
    with pytest.raises(ScanError, match="usable depth readings") as caught:
        estimate_trajectory(with_blanks(walk, tmp_path, 1, 3), OdometryConfig(), Job())
    assert "blank.png" in caught.value.where


def test_a_frame_of_something_else_is_left_out_and_the_path_resumed(walk, tmp_path):
    """Frame 2 is a wall half a metre away, in the colours of the scene."""
    job = Job()
    found = estimate_trajectory(with_blanks(walk, tmp_path, 2, reading=500), OdometryConfig(), job)
    good = [0, 1, 3, 4]
    assert np.isnan(found[2]).all()
    assert np.linalg.norm(centred(found[good], walk[1][good]), axis=1).max() < 5e-3  # steps of 280 mm
    assert any("left out 1 of 5 frames" in text and "lost track" in text for text in job.warnings)


def few(walk, *chosen):
    frames = walk[0]
    depth, color = tuple(frames.depth_paths[k] for k in chosen), tuple(frames.color_paths[k] for k in chosen)
    return replace(frames, depth_paths=depth, color_paths=color)


def test_jump_to_the_other_side_is_told(walk):
    """A round tube fits itself however it is turned; only the print shows that these frames have little in common."""
    job = Job()
    estimate_trajectory(few(walk, 0, 10), OdometryConfig(), job)
    assert any("shape alone" in text for text in job.warnings)


def test_too_little_overlap_is_refused(walk):
    with pytest.raises(ScanError, match="lost track") as caught:
        estimate_trajectory(few(walk, 0, 5), OdometryConfig(min_overlap=0.95), Job())
    assert caught.value.where == "000005.png to 000000.png"


def test_short_path_without_colour_warns_of_drift(scene, walk, tmp_path):
    frames = depth_frames(scene, tmp_path, walk[1][:1].repeat(5, axis=0), walk[0].intrinsics, noise=0.0005)
    job = Job()
    poses = estimate_trajectory(replace(frames, color_paths=()), OdometryConfig(), job)
    assert np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1).max() < 2e-3  # the camera stood still
    assert any("colour" in text for text in job.warnings)
    assert any("loop" in text for text in job.warnings)
