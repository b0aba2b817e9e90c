"""The committed photos: EXIF, the board seen where the true cameras say, and what a pixel shows."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image

from vto_pipeline.bench.samples.captures.board import BOARD, charuco, world_from_board
from vto_pipeline.bench.samples.captures.photos import exposed
from vto_pipeline.bench.samples.captures.viewpoints import on_ring
from vto_pipeline.io.captures.cameras import read_cameras
from vto_pipeline.io.captures.images import read_image_size
from vto_pipeline.io.captures.photos import read_photos

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def photos():
    return read_photos(SAMPLES / "shirt_on_form" / "photos")


@pytest.fixture(scope="module")
def cameras():
    return read_cameras(SAMPLES / "truth" / "photo_cameras.json")


def test_there_are_36_photos_and_the_board_is_described(photos, cameras):
    assert len(photos.paths) == 36
    assert tuple(path.name for path in photos.paths) == cameras.names
    assert photos.board == BOARD
    assert {read_image_size(path) for path in photos.paths} == {(800, 600)}


def test_exif_gives_880_pixels_three_ways(photos):
    with Image.open(photos.paths[0]) as image:
        details = image.getexif().get_ifd(0x8769)
    assert float(details[0x920A]) * float(details[0xA20E]) / 10.0 == 880.0  # mm x px/cm
    assert details[0xA210] == 3
    by_film = details[0xA405] / np.hypot(36.0, 24.0) * np.hypot(800, 600)
    assert by_film == pytest.approx(880.0, rel=0.013)  # the tag is a whole number: half of 1 in 38
    for guess in photos.intrinsics:
        assert (guess.fx, guess.fy, guess.cx, guess.cy) == (880.0, 880.0, 399.5, 299.5)


def test_board_is_seen_where_the_true_cameras_say(photos, cameras):
    board = charuco(BOARD)
    detector = cv2.aruco.CharucoDetector(board)
    placed = world_from_board(BOARD)
    seen, errors = 0, []
    for path, lens, pose in zip(photos.paths, cameras.intrinsics, cameras.world_from_cam, strict=True):
        corners, ids, _, _ = detector.detectBoard(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        if ids is None or len(ids) < 6:
            continue
        seen += 1
        world = board.getChessboardCorners()[ids.ravel()] @ placed[:3, :3].T + placed[:3, 3]
        x, y, z = ((world - pose[:3, 3]) @ pose[:3, :3]).T
        expected = np.stack([lens.fx * x / z + lens.cx, lens.fy * y / z + lens.cy], axis=1)
        errors.append(np.linalg.norm(expected - corners.reshape(-1, 2), axis=1))
    assert seen >= 16
    assert np.median(np.concatenate(errors)) < 0.2
    assert np.percentile(np.concatenate(errors), 95) < 0.5
    assert max(np.median(e) for e in errors) < 0.5


def test_board_frame_makes_the_floor_level_and_the_origin_its_middle():
    placed = world_from_board(BOARD)
    assert_allclose(placed[:3, :3] @ placed[:3, :3].T, np.eye(3), rtol=0, atol=0)
    assert np.linalg.det(placed[:3, :3]) == pytest.approx(1.0, abs=1e-15)
    middle = np.array([0.5 * BOARD.columns * BOARD.square_m, 0.5 * BOARD.rows * BOARD.square_m, 0.0, 1.0])
    assert_allclose((placed @ middle)[:3], 0.0, rtol=0, atol=1e-15)
    assert_allclose(placed[:3, 2], [0.0, -1.0, 0.0], rtol=0, atol=0)  # board z into the floor


def test_a_camera_on_the_ring_sees_its_target_in_the_middle_and_up_is_up():
    target = np.array([0.1, 0.4, -0.2])
    pose = on_ring(1.3, 20.0, 35.0, target)
    assert_allclose((target - pose[:3, 3]) @ pose[:3, :3], [0.0, 0.0, 1.3], rtol=0, atol=1e-12)
    assert pose[1, 1] < -0.9  # the picture's y points down
    assert pose[1, 3] > target[1]


def test_sensor_noise_is_two_levels():
    flat = np.full((200, 300, 3), 0.5)
    noise = exposed(flat, 1).astype(float) - 127.5
    assert_allclose(noise.std(), np.sqrt(4.0 + 1.0 / 12.0), rtol=0.01, atol=0)  # 2/255 and rounding; 180,000 samples
    assert abs(noise.mean()) < 0.02
