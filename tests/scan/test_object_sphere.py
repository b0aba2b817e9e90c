"""Where cameras look, in closed form."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose
from scan_scene import look_at, orbit

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.object_sphere import inside_sphere, object_sphere


def test_a_ring_looks_at_its_middle():
    sphere = object_sphere(orbit(24, distance=1.0))
    assert_allclose(sphere.center, [0, 0.24, 0], atol=1e-9)
    assert_allclose(sphere.radius, 1.0, rtol=1e-9)


def test_who_scans_a_tall_object_at_all_heights_keeps_all_of_it():
    """0.6 m from a person of 1.8 m."""
    turns, heights = np.meshgrid(np.linspace(0, 2 * np.pi, 20, endpoint=False), [0.2, 0.6, 1.0, 1.4, 1.7])
    poses = [
        look_at(np.array([0.6 * np.cos(t), y, 0.6 * np.sin(t)]), np.array([0, y, 0]))
        for t, y in zip(turns.ravel(), heights.ravel(), strict=True)
    ]
    sphere = object_sphere(np.array(poses))
    assert sphere.radius > np.linalg.norm(np.array([0.25, 0.0, 0]) - sphere.center)
    assert sphere.radius > np.linalg.norm(np.array([0.1, 1.8, 0]) - sphere.center)


def test_cameras_that_look_outwards_or_one_way_see_no_object():
    outwards = orbit(24)
    outwards[:, :3, :3] = outwards[:, :3, :3] @ np.diag([-1.0, 1.0, -1.0])
    assert object_sphere(outwards) is None
    aside = np.tile(np.eye(4), (10, 1, 1))
    aside[:, 0, 3] = np.linspace(0, 1, 10)
    assert object_sphere(aside) is None


def test_only_what_is_in_the_ball_is_left():
    camera = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
    pose = look_at(np.array([1.0, 0.5, 0.0]), np.zeros(3))
    depth = np.linspace(0.2, 4.0, 48 * 64).astype(np.float32).reshape(48, 64)
    sphere = object_sphere(orbit(12))
    left = inside_sphere(depth, camera, pose, sphere)
    for row, column in np.random.default_rng(0).integers(0, [48, 64], (200, 2)):
        point = depth[row, column] * np.array([(column - 31.5) / 60, (row - 23.5) / 60, 1])
        away = np.linalg.norm(pose[:3, :3] @ point + pose[:3, 3] - sphere.center)
        assert left[row, column] == (depth[row, column] if away < sphere.radius else 0)
