"""Keyframes refined together, on frames whose cameras are known."""

from __future__ import annotations

import numpy as np
import pytest
from scan_scene import render
from scipy.spatial.transform import Rotation

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.job import Job
from vto_pipeline.scan.depth.bundle import PARTNERS, choose_pairs, refine_together
from vto_pipeline.scan.depth.rgbd_frame import prepare_frame

CAMERA = Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5)


@pytest.fixture(scope="module")
def seen(scene, walk):
    """Frames without noise, and their poses."""
    frames = []
    for pose in walk[1]:
        color, depth = render(scene, CAMERA, pose, samples=1)
        frames.append(prepare_frame(color, depth, CAMERA))
    return frames, walk[1]


def centres_off(poses, truth):
    """Distances of the cameras from the truth [m], after a rigid fit (Kabsch 1976)."""
    a, b = poses[:, :3, 3] - poses[:, :3, 3].mean(0), truth[:, :3, 3] - truth[:, :3, 3].mean(0)
    turn, _ = Rotation.align_vectors(b, a)
    return np.linalg.norm(turn.apply(a) - b, axis=1)


def test_scattered_poses_come_together(seen):
    frames, truth = seen
    random = np.random.default_rng(0)
    start = truth.copy()
    for pose in start[1:]:
        pose[:3, :3] = Rotation.from_rotvec(random.normal(0, 0.003, 3)).as_matrix() @ pose[:3, :3]
        pose[:3, 3] += random.normal(0, 0.003, 3)
    assert centres_off(start, truth).max() > 4e-3
    found = refine_together(frames, start, np.radians(45), Job())
    assert (found.world_from_cam[0] == start[0]).all()
    assert centres_off(found.world_from_cam, truth).max() < 1.2e-3  # pixels are 2.9 mm on the tube
    assert found.pairs > 4 * len(frames)


def test_the_distance_from_the_object_is_found(seen):
    """Every camera 3 mm too far out: neighbours hardly notice, frames that look across each other do."""
    frames, truth = seen
    start = truth.copy()
    start[:, :3, 3] -= 0.003 * start[:, :3, 2]
    off = {}
    for widest in (20.0, 50.0):
        found = refine_together(frames, start, np.radians(widest), Job()).world_from_cam
        off[widest] = abs(ring(found) / ring(truth) - 1)
    assert ring(start) / ring(truth) - 1 > 3e-3
    assert off[50.0] < 5e-4


def ring(poses):
    """Mean distance of the cameras from their middle [m]."""
    return np.linalg.norm(poses[:, :3, 3] - poses[:, :3, 3].mean(0), axis=1).mean()


def test_many_frames_have_no_more_partners_each_and_these_at_all_angles():
    turns = np.radians(np.arange(0, 360, 0.5))
    poses = np.tile(np.eye(4), (len(turns), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.column_stack([0 * turns, turns, 0 * turns])).as_matrix()
    pairs = np.array(choose_pairs(poses, np.radians(45)))
    angle = np.abs((turns[pairs[:, 0]] - turns[pairs[:, 1]] + np.pi) % (2 * np.pi) - np.pi)
    assert (np.bincount(pairs[:, 1]) == PARTNERS).all()
    assert np.degrees(angle.max()) < 45.01
    shares = np.histogram(np.degrees(angle), [0, 15, 30, 45.01])[0] / len(pairs)
    assert np.abs(shares - 1 / 3).max() < 0.05
    few = choose_pairs(poses[::60], np.radians(45))
    assert len(few) == 2 * 12
    assert all(i != j for i, j in few)


def test_a_frame_that_sees_nothing_of_the_others_stays(seen):
    frames, truth = seen
    start = truth[:4].copy()
    start[3, :3, :3] = start[3, :3, :3] @ Rotation.from_rotvec([0, 3.0, 0]).as_matrix()
    found = refine_together(frames[:4], start, np.radians(45), Job())
    assert np.abs(found.world_from_cam[3] - start[3]).max() < 1e-9
