from __future__ import annotations

import cv2
import numpy as np
from numpy.testing import assert_allclose
from scan_scene import BOARD, charuco
from scipy.spatial.transform import Rotation

from vto_pipeline.scan.photos.board import board_corners
from vto_pipeline.scan.similarity import fit_similarity
from vto_pipeline.scan.upright import upright_from_scan


def test_similarity_is_recovered():
    random = np.random.default_rng(0)
    points = random.normal(size=(30, 3))
    rotation, shift = Rotation.from_rotvec([0.3, -1.2, 0.5]).as_matrix(), np.array([0.1, -2.0, 3.0])
    scale, transform = fit_similarity(points, 0.37 * points @ rotation.T + shift)
    assert_allclose(scale, 0.37, rtol=1e-12, atol=0)  # exact data: rounding only
    assert_allclose(transform[:3, :3], rotation, rtol=0, atol=1e-12)
    assert_allclose(transform[:3, 3], shift, rtol=0, atol=1e-12)


def test_similarity_of_a_plane_is_never_a_reflection():
    random = np.random.default_rng(1)
    flat = np.column_stack([random.normal(size=(20, 2)), np.zeros(20)])
    noisy = flat + random.normal(0, 1e-3, flat.shape)
    assert_allclose(np.linalg.det(fit_similarity(flat, noisy)[1][:3, :3]), 1.0, rtol=1e-9, atol=0)


def test_board_corners_are_opencvs_laid_on_the_floor():
    opencv = charuco().getChessboardCorners()
    size = np.array([BOARD.columns, BOARD.rows]) * BOARD.square_m
    laid = np.column_stack([opencv[:, 0] - size[0] / 2, -opencv[:, 2], opencv[:, 1] - size[1] / 2])
    assert_allclose(board_corners(BOARD), laid, rtol=0, atol=1e-7)  # OpenCV keeps them in single precision


def test_board_seen_from_above_is_seen_from_plus_y():
    """OpenCV's own pose of a picture of the print, taken from the side the ink is on."""
    corners, ids, _, _ = cv2.aruco.CharucoDetector(charuco()).detectBoard(charuco().generateImage((900, 700)))
    lens = np.array([[800.0, 0, 450], [0, 800, 350], [0, 0, 1]])
    _, turn, shift = cv2.solvePnP(board_corners(BOARD)[ids.ravel()], corners.reshape(-1, 2), lens, None)
    center = -cv2.Rodrigues(turn)[0].T @ shift.ravel()
    assert center[1] > 0.1


def test_upright_undoes_a_turn():
    random = np.random.default_rng(2)
    turns = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    eyes = np.stack([2 * np.sin(turns), np.full(12, 1.0), 2 * np.cos(turns)], axis=1)
    poses = np.tile(np.eye(4), (12, 1, 1))
    for pose, eye in zip(poses, eyes, strict=True):
        forward = -eye * [1, 0, 1] / 2
        pose[:3, :3] = np.stack([np.cross([0, -1, 0], forward), [0, -1, 0], forward], axis=1)
        pose[:3, 3] = eye
    points = random.uniform(-0.3, 0.3, (500, 3)) * [1, 2, 1] + [0, 0.6, 0]
    tilt = np.eye(4)
    tilt[:3, :3], tilt[:3, 3] = Rotation.from_rotvec([0.9, 0.4, -2.0]).as_matrix(), [3, 1, -2]
    found = upright_from_scan(tilt @ poses, points @ tilt[:3, :3].T + tilt[:3, 3]) @ tilt
    assert_allclose(found[:3, :3], np.eye(3), rtol=0, atol=0.02)  # the middle of random points is not quite on the axis
    lowest = points @ found[:3, :3].T + found[:3, 3]
    assert_allclose(lowest[:, 1].min(), 0.0, rtol=0, atol=5e-3)  # 0.1 % percentile of 500 points
