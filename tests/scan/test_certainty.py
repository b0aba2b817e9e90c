"""How certain cameras are, beside how far they come out from the truth when the noise is drawn again and again."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from numpy.testing import assert_allclose
from scan_scene import BOARD, orbit

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.scan.photos.board import board_corners
from vto_pipeline.scan.photos.matching.adjust import solve
from vto_pipeline.scan.photos.matching.certainty import uncertainty_px
from vto_pipeline.scan.photos.sfm import load_colmap
from vto_pipeline.scan.similarity import fit_similarity

LENS = Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)
MIDDLE = np.array([0.0, 0.24, 0.0])
NOISE_PX = 0.3
LOW = orbit(8, elevations_deg=(25.0,))


def project(points, pose):
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    return local[:, :2] / local[:, 2:] * LENS.fx + [LENS.cx, LENS.cy]


def model_of(poses, points, random, noise=NOISE_PX):
    """A reconstruction that knows the truth, and sightings that are off by noise."""
    model = pycolmap.Reconstruction()
    params = [LENS.fx, LENS.cx + 0.5, LENS.cy + 0.5, 0.0]
    camera = pycolmap.Camera(model="SIMPLE_RADIAL", width=LENS.width, height=LENS.height, params=params, camera_id=1)
    model.add_camera_with_trivial_rig(camera)
    for k, pose in enumerate(poses):
        pixels = project(points, pose) + 0.5 + random.normal(0, noise, (len(points), 2))
        image = pycolmap.Image(f"{k}", pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in pixels]), 1, k + 1)
        turn, shift = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(turn), shift))
    for row, xyz in enumerate(points):
        track = pycolmap.Track([pycolmap.TrackElement(k + 1, row) for k in range(len(poses))])
        model.add_point3D(xyz, track, np.zeros(3, np.uint8))
    return model


def shown_off(model, poses):
    """How far from the truth a model shows the middle [px], shape (C, 2), once its centres are put on the true ones."""
    ids = sorted(model.images)
    centers = np.array([model.images[k].projection_center() for k in ids])
    scale, transform = fit_similarity(poses[:, :3, 3], centers)
    there = scale * transform[:3, :3] @ MIDDLE + transform[:3, 3]
    focal = model.cameras[1].focal_length
    off = []
    for number, pose in zip(ids, poses, strict=True):
        local = model.images[number].cam_from_world() * there
        off.append(local[:2] / local[2] * focal + [LENS.cx, LENS.cy] - project(MIDDLE[None], pose)[0])
    return np.array(off)


def around(count, random):
    """Points of a ball about the middle."""
    ways = random.normal(size=(count, 3))
    return MIDDLE + 0.15 * ways / np.linalg.norm(ways, axis=1, keepdims=True)


@pytest.fixture(scope="module", autouse=True)
def colmap():
    load_colmap(0)


@pytest.mark.parametrize("where", ["board", "round", "both"])
def test_the_spread_of_repeated_adjustments_is_foretold(where):
    random = np.random.default_rng(1)
    board, ball = board_corners(BOARD)[::5], around(14, random)
    points = {"board": board, "round": ball, "both": np.vstack([board, ball])}[where]
    off, said = [], []
    for _ in range(60):
        model = model_of(LOW, points, random)
        solve(model, 100.0, bent=False)
        off.append(shown_off(model, LOW))
        said.append(uncertainty_px(model))
    seen = np.sqrt(np.mean(np.square(off).sum(axis=2), axis=0))
    assert_allclose(np.sqrt(np.mean(np.square(said), axis=0)), seen, rtol=0.2, atol=0)  # 60 draws: 9 %


def test_the_board_alone_tells_less_of_what_stands_over_it():
    random = np.random.default_rng(2)
    board, ball = board_corners(BOARD)[::5], around(14, random)
    alone = uncertainty_px(model_of(LOW, board, random)).min()
    assert alone > 3.0 * uncertainty_px(model_of(LOW, np.vstack([board, ball]), random)).max()


def test_it_is_the_same_in_any_frame_and_unit():
    random = np.random.default_rng(3)
    model = model_of(LOW, around(40, random), random)
    before = uncertainty_px(model)
    turn = pycolmap.Rotation3d(np.array([0.2, -0.5, 0.1, 0.8]) / np.linalg.norm([0.2, -0.5, 0.1, 0.8]))
    model.transform(pycolmap.Sim3d(0.01, turn, np.array([30.0, -7.0, 2.0])))
    assert_allclose(uncertainty_px(model), before, rtol=1e-6, atol=0)


def test_exact_sightings_leave_nothing_open():
    random = np.random.default_rng(4)
    assert uncertainty_px(model_of(LOW, around(40, random), random, noise=0.0)).max() < 1e-6


def test_a_photo_that_shares_little_is_uncertain_alone():
    random = np.random.default_rng(5)
    model = model_of(LOW, around(60, random), random)
    before = uncertainty_px(model)
    for number in list(model.points3D)[4:]:
        track = model.points3D[number].track.elements
        model.delete_observation(3, next(sighting.point2D_idx for sighting in track if sighting.image_id == 3))
    said = uncertainty_px(model)
    assert said[2] > 3.0 * before[2]
    assert_allclose(np.delete(said, 2), np.delete(before, 2), rtol=0.3, atol=0)
