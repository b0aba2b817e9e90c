"""Scenes rendered once for all tests of the scan."""

from __future__ import annotations

import numpy as np
import pytest
from scan_scene import Scene, depth_frames, look_at, make_scene, orbit, photos

from vto_pipeline.model.camera import CameraSet, Intrinsics
from vto_pipeline.model.frames import DepthFrameSet, PhotoSet

PHOTO = Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)
DEPTH = Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5)


@pytest.fixture(scope="session")
def scene() -> Scene:
    return make_scene()


@pytest.fixture(scope="session")
def shot(scene, tmp_path_factory) -> tuple[PhotoSet, np.ndarray]:
    """Photos all round, and where they were taken from."""
    poses = orbit(16, elevations_deg=(22.0,))
    return photos(scene, tmp_path_factory.mktemp("photos"), poses, PHOTO), poses


@pytest.fixture(scope="session")
def true_cameras(shot) -> CameraSet:
    found, poses = shot
    return CameraSet(tuple(path.name for path in found.paths), found.intrinsics, poses)


@pytest.fixture(scope="session")
def walk(scene, tmp_path_factory) -> tuple[DepthFrameSet, np.ndarray]:
    """Depth frames of a walk once round and a little more."""
    target = np.array([0, 0.24, 0])
    turns = 2 * np.pi * 1.1 * np.arange(22) / 22
    rise = np.radians(20 + 10 * np.sin(2 * turns))
    offset = np.stack([np.cos(rise) * np.sin(turns), np.sin(rise), np.cos(rise) * np.cos(turns)], axis=1)
    poses = np.array([look_at(target + 0.9 * step, target) for step in offset])
    return depth_frames(scene, tmp_path_factory.mktemp("depth"), poses, DEPTH, noise=0.001), poses
