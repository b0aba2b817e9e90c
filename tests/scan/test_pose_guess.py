"""Motion between two depth frames from matched features: a known one, and features that tell none."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import render
from scipy.spatial.transform import Rotation

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.depth.pose_guess import RATIO, ImageFeatures, clear_matches, find_features, guess_motion

CAMERA = Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5, width=640, height=480)


def seen(points, descriptors):
    flat = points[:, :2] / points[:, 2:]
    return ImageFeatures(flat * [CAMERA.fx, CAMERA.fy] + [CAMERA.cx, CAMERA.cy], points, descriptors)


def descriptors_of(count, rng):
    return rng.random((count, 128)).astype(np.float32)


@pytest.mark.parametrize("orientations", [1, 4])
def test_a_known_motion_is_found(orientations):
    rng = np.random.default_rng(3)
    points = np.repeat(rng.uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 1.6], (60, 3)), orientations, axis=0)
    descriptors = descriptors_of(len(points), rng)
    turn, shift = Rotation.from_rotvec([0.05, -0.2, 0.1]).as_matrix(), np.array([0.1, -0.02, 0.05])
    motion = guess_motion(seen(points, descriptors), seen(points @ turn.T + shift, descriptors), CAMERA)
    assert_allclose(motion[:3, :3], turn, rtol=0, atol=1e-6)
    assert_allclose(motion[:3, 3], shift, rtol=0, atol=1e-6)


@pytest.mark.parametrize("places", [1, 2, 10])
def test_features_in_few_places_tell_no_motion(places):
    """OpenCV's solver fails on a sample without extent, and many features of one place are no evidence."""
    rng = np.random.default_rng(4)
    points = np.repeat(rng.uniform([-0.4, -0.3, 0.8], [0.4, 0.3, 1.6], (places, 3)), 200 // places, axis=0)
    descriptors = descriptors_of(len(points), rng)
    assert guess_motion(seen(points, descriptors), seen(points, descriptors), CAMERA) is None


@pytest.mark.parametrize("spread", [0.0, 1e-12, 1e-9, 1e-7])
def test_what_the_solver_refuses_is_no_motion(spread):
    rng = np.random.default_rng(5)
    points = [0.1, 0.1, 1.0] + spread * rng.standard_normal((100, 3))
    descriptors = descriptors_of(len(points), rng)
    source, target = seen(points, descriptors), seen(points, descriptors)
    motion = guess_motion(source, target, CAMERA)
    assert motion is None or np.isfinite(motion).all()


def test_a_faint_print_tells_the_motion(scene, walk):
    """Colours as of an overexposed pastel print: a quarter of the contrast, rounded to whole levels."""
    camera = walk[0].intrinsics
    seen = []
    for pose in walk[1][:2]:
        color, depth = render(scene, camera, pose)
        seen.append(find_features(np.round(200 + 0.25 * (color.astype(float) - 140)).astype(np.uint8), depth, camera))
    motion = guess_motion(*seen, camera)
    assert motion is not None
    truth = np.linalg.inv(walk[1][1]) @ walk[1][0]
    assert_allclose(motion[:3, 3], truth[:3, 3], rtol=0, atol=0.01)  # of 280 mm
    assert_allclose(motion[:3, :3], truth[:3, :3], rtol=0, atol=0.02)


@pytest.mark.parametrize("count", [2, 30, 700])
def test_clear_matches_are_those_of_an_independent_matcher(count):
    """Descriptors as SIFT's: some of them twice, some a little changed."""
    rng = np.random.default_rng(count)
    target = np.minimum(rng.exponential(25.0, (count, 128)), 255).astype(np.uint8)
    source = np.vstack([target, np.minimum(rng.exponential(25.0, (40, 128)), 255)]).astype(np.int64)
    source = np.clip(source + rng.integers(-12, 13, source.shape), 0, 255).astype(np.uint8)
    target[1] = target[0]
    found = cv2.BFMatcher(cv2.NORM_L2).knnMatch(source, target, k=2)
    wanted = [(m.queryIdx, m.trainIdx) for m, second in found if m.distance < RATIO * second.distance]
    assert list(zip(*clear_matches(source, target), strict=True)) == wanted
    assert len(wanted) >= min(count - 2, 600)


def test_frames_without_colour_or_texture_have_no_features():
    depth = np.ones((480, 640), np.float32)
    blank = np.full((480, 640, 3), 90, np.uint8)
    for color in (None, blank):
        features = find_features(color, depth, CAMERA)
        assert guess_motion(features, features, CAMERA) is None
