"""The grey in which a print shows best: for two colours it has a formula, and a print without brightness is matched."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan.grey import USUAL, best_differences, best_shares, in_grey
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.photos.stereo import StereoConfig, estimate_depth_maps
from vto_pipeline.scan.similarity import fit_similarity

EVERYWHERE = np.stack(np.meshgrid(np.arange(5.0, 155.0), np.arange(5.0, 115.0)), -1).reshape(-1, 2)


def printed(one, other, seed=0):
    """Dots of one colour on another."""
    rng = np.random.default_rng(seed)
    dots = cv2.GaussianBlur(rng.normal(0, 1, (120, 160)).astype(np.float32), (0, 0), 1.5)[..., None] > 0
    return np.clip(np.where(dots, one, other) + rng.normal(0, 1, (120, 160, 3)), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("one", "other"),
    [((150, 90, 60), (90, 100, 60)), ((120, 128, 200), (130, 130, 100)), ((200, 60, 160), (100, 93, 150))],
)
def test_two_colours_are_best_told_apart_along_what_differs(one, other):
    """Against equal noise in each channel the best direction is the difference itself, or of one sign what it has."""
    apart = np.array(one, float) - other
    kept = max(np.maximum(apart, 0), np.maximum(-apart, 0), key=np.linalg.norm)
    shares, gain = best_shares([(printed(one, other), EVERYWHERE)])
    assert_allclose(shares, kept / kept.sum(), rtol=0, atol=0.11)  # steps of 0.1
    usual = abs(np.dot(USUAL, apart)) / np.linalg.norm(USUAL)
    assert_allclose(gain, np.linalg.norm(kept) / usual, rtol=0.12)


def test_a_print_in_black_and_white_is_seen_as_the_eye_does():
    shares, gain = best_shares([(printed((60, 60, 60), (180, 180, 180)), EVERYWHERE)])
    assert (tuple(shares), gain) == (USUAL, 1.0)
    picture = printed((200, 60, 160), (100, 113, 150))
    assert in_grey(picture, shares).tobytes() == cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).tobytes()


def test_where_light_is_clipped_nothing_is_learnt():
    """The edge of a clipped patch is strong and no print. Beside it dots differ in blue alone."""
    picture = printed((150, 100, 160), (150, 100, 120))
    picture[:, :80, 0] = np.where(np.arange(80) % 16 < 8, 255, 90)
    for places in (EVERYWHERE, EVERYWHERE[EVERYWHERE[:, 0] < 75]):
        assert_allclose(best_shares([(picture, places)])[0], [0, 0, 1], rtol=0, atol=0.11)


def beside_a_wall(one, other, noise, seed=1):
    """Dots of one colour on another, and as much of a bare wall, with noise of a covariance (3, 3)."""
    rng = np.random.default_rng(seed)
    dots = cv2.GaussianBlur(rng.normal(0, 1, (240, 320)).astype(np.float32), (0, 0), 2.5)[..., None] > 0
    shown = np.where(dots & (np.arange(320) < 160)[:, None], one, other).astype(float)
    return np.rint(np.clip(shown + rng.multivariate_normal(np.zeros(3), noise, (240, 320)), 0, 255)).astype(np.uint8)


def ratio(shares, apart, noise):
    """What a sum of channels shows of two colours against its noise: that is averaged by a Gaussian of 1 px, whose
    square sums to 1 / 4 pi, and then rounded."""
    shares = np.asarray(shares)
    return abs(shares @ apart) / np.sqrt(shares @ noise @ shares / (4.0 * np.pi) + 1.0 / 12.0)


@pytest.mark.parametrize("shared", [0.0, 0.9])
@pytest.mark.parametrize(("one", "other"), [((150, 90, 60), (90, 100, 120)), ((100, 128, 180), (150, 128, 100))])
def test_two_colours_are_told_apart_by_what_shows_them_best_against_the_noise(one, other, shared):
    """Independent noise, and such as compression leaves: nine tenths of it alike in all channels."""
    noise = 16.0 * (shared * np.ones((3, 3)) + (1.0 - shared) * np.eye(3))
    apart = np.array(one, float) - other
    shares, gain = best_differences([beside_a_wall(one, other, noise, seed) for seed in range(3)])
    assert_allclose(np.abs(shares).sum(), 1.0, rtol=1e-12, atol=0)
    turns = np.random.default_rng(0).normal(size=(20_000, 3))
    most = max(ratio(way / np.abs(way).sum(), apart, noise) for way in turns)
    assert ratio(shares, apart, noise) > 0.97 * most
    best = ratio(shares, apart, noise) / ratio(USUAL, apart, noise)
    assert 0.7 * best < gain < 1.02 * best  # noise on the print counts as shown, and most of it in the usual grey


def test_a_print_in_black_and_white_needs_no_differences():
    """Nor do photos of nothing, or of light alone."""
    noise = 9.0 * np.eye(3)
    black = beside_a_wall((60, 60, 60), (180, 180, 180), noise)
    for pictures in ([black], [np.full_like(black, 90)], [np.full_like(black, 255)], []):
        shares, gain = best_differences(pictures)
        assert (tuple(shares), gain) == (USUAL, 1.0)


def test_a_difference_of_channels_has_room_for_all_levels():
    colors = np.array([[[0, 0, 0], [255, 0, 0], [0, 0, 255], [255, 255, 255], [200, 7, 100]]], np.uint8)
    assert in_grey(colors, np.array([0.6, 0.0, -0.4])).tolist() == [[102, 255, 0, 153, 182]]


def test_photos_of_a_noisy_print_of_one_brightness_are_placed(shot, tmp_path):
    """In red against blue, so that the eye's grey shows the noise alone, which is one of brightness."""
    rng = np.random.default_rng(2)
    for path in shot[0].paths:
        level = 0.5 * (cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2GRAY).astype(float) - 128.0)
        blue, red = 128.0 + level, 128.0 - USUAL[2] / USUAL[0] * level
        even = np.stack([blue, np.full_like(blue, 128.0), red], -1) + rng.normal(0, 4, level.shape)[..., None]
        cv2.imwrite(str(tmp_path / f"{path.stem}.png"), np.rint(even.clip(0, 255)).astype(np.uint8))
    paths, job = tuple(tmp_path / f"{path.stem}.png" for path in shot[0].paths), Job()
    cameras, _ = estimate_cameras(PhotoSet(paths, shot[0].intrinsics), SfmConfig(enough_features=20_000), job)
    red, _, blue = job.metrics["feature_grey_shares"]
    assert red * blue < 0
    assert not cameras.unregistered
    centers, truth = cameras.world_from_cam[:, :3, 3], shot[1][:, :3, 3]
    scale, transform = fit_similarity(centers, truth)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)
    assert np.median(error) < 2e-3  # at 1 m, as of a print in black and white


def test_a_print_of_one_brightness_is_matched(shot, true_cameras, scene, tmp_path):
    """The same photos with their print in blue against green, so that the eye's grey is even."""
    for path in shot[0].paths:
        level = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2GRAY).astype(float) - 128.0
        blue, green = 128.0 + level, 128.0 - USUAL[2] / USUAL[1] * level
        even = np.stack([blue, green, np.full_like(blue, 128.0)], -1)
        cv2.imwrite(str(tmp_path / f"{path.stem}.png"), np.rint(even).astype(np.uint8))
    paths = tuple(tmp_path / f"{path.stem}.png" for path in shot[0].paths)
    cameras = type(true_cameras)(
        tuple(path.name for path in paths), true_cameras.intrinsics, true_cameras.world_from_cam, true_cameras.metric
    )
    step = scene.vertices[::7]
    normals = step * [1, 0, 1] / np.linalg.norm(step * [1, 0, 1], axis=1, keepdims=True)
    job = Job()
    photos, config = PhotoSet(paths, shot[0].intrinsics), StereoConfig(rematch={"rounds": 0})
    found = estimate_depth_maps(photos, cameras, PointCloud(step, normals), config, job)
    assert job.metrics["grey_shares"][2] > 0.7
    assert min((depth > 0).sum() for depth in found.depth) > 0.4 * 20_000
