"""Planes fitted in inverse depth, beside known planes seen by a disparity sensor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.depth.rgbd_frame import prepare_frame
from vto_pipeline.scan.photos.consistency import rays

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
BASELINE, STEPS_PER_PX = 0.075, 8


def plane_depth(camera, normal, offset):
    """Depth of the plane normal . X = offset, shape (H, W)."""
    return offset / (rays(camera.matrix, camera.height, camera.width) @ normal)


def unit(*vector):
    return np.array(vector) / np.linalg.norm(vector)


@pytest.mark.parametrize("normal", [unit(0.0, 0.0, 1.0), unit(0.5, -0.3, 1.0), unit(-1.2, 0.4, 1.0)])
def test_a_plane_is_fitted_exactly(normal):
    depth = plane_depth(CAMERA, normal, 1.1 * normal[2]).astype(np.float32)
    frame = prepare_frame(None, depth, CAMERA)
    small = frame.camera
    assert (small.width, small.height) == (320, 240)
    ray = rays(small.matrix, small.height, small.width)
    seen = ray @ normal > 0.3 * np.linalg.norm(ray, axis=2)
    seen[[0, 1, 2, -3, -2, -1]] = seen[:, [0, 1, 2, -3, -2, -1]] = False  # windows cut off by the picture's edge
    assert seen.sum() > 30_000
    assert_allclose(frame.depth[seen], plane_depth(small, normal, 1.1 * normal[2])[seen], rtol=1e-5)  # float32
    assert_allclose(frame.normals[seen], np.broadcast_to(-normal, (seen.sum(), 3)), rtol=0, atol=1e-3)


def test_steps_of_disparity_are_averaged_out_without_bias():
    """A reading is off by up to 1.9 mm; its mean over a window must be the plane's, not farther."""
    normal = unit(0.4, 0.3, 1.0)
    true = plane_depth(CAMERA, normal, 1.1 * normal[2])
    factor = CAMERA.fx * BASELINE * STEPS_PER_PX
    stepped = (factor / np.round(factor / true)).astype(np.float32)
    frame = prepare_frame(None, stepped, CAMERA)
    inner = np.s_[5:-5, 5:-5]
    off = (frame.depth - plane_depth(frame.camera, normal, 1.1 * normal[2]))[inner]
    assert np.std(stepped - true) > 9e-4
    assert np.std(off) < 4e-4
    assert abs(off.mean()) < 5e-5


def test_a_jump_is_not_smoothed_over():
    depth = np.full((480, 640), 1.0, np.float32)
    depth[:, 320:] = 1.3
    frame = prepare_frame(None, depth, CAMERA)
    known = frame.depth > 0
    assert known.mean() > 0.95
    assert_allclose(np.minimum(abs(frame.depth - 1.0), abs(frame.depth - 1.3))[known], 0.0, atol=1e-5)  # float32


def test_surfaces_seen_obliquely_take_no_part():
    for tilt, kept in ((60, True), (80, False)):
        normal = np.array([np.sin(np.radians(tilt)), 0.0, np.cos(np.radians(tilt))])
        camera = Intrinsics(64, 48, 300.0, 300.0, 31.5, 23.5)
        frame = prepare_frame(None, plane_depth(camera, normal, normal[2]).astype(np.float32), camera)
        assert bool((frame.depth[24, 28:36] > 0).all()) == kept
        assert bool((frame.depth[24, 28:36] > 0).any()) == kept


def test_a_smaller_camera_sees_the_same_rays():
    """The middle of four pixels, in both."""
    small = CAMERA.reduced(2)
    whole, half = rays(CAMERA.matrix, 480, 640), rays(small.matrix, 240, 320)
    assert_allclose(half, whole.reshape(240, 2, 320, 2, 3).mean((1, 3)), atol=1e-12)
