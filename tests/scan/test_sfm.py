from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scan_scene import BOARD, distances, make_scene, orbit, photos

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.scan.photos import scale as scale_module
from vto_pipeline.scan.photos import sfm as sfm_module
from vto_pipeline.scan.photos.board import board_corners
from vto_pipeline.scan.photos.matching.features import SURE, FeatureConfig, detect, match
from vto_pipeline.scan.photos.matching.mapping import copy_database
from vto_pipeline.scan.photos.scale import ScaleConfig, apply_board, apply_scale
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.similarity import fit_similarity
from vto_pipeline.stages.levels import LEVELS


@pytest.fixture(scope="module")
def sparse(shot):
    job = Job()
    return *estimate_cameras(shot[0], SfmConfig(), job), job


def test_every_photo_is_placed_where_it_was_taken(sparse, shot):
    cameras, _, job = sparse
    assert cameras.names == tuple(path.name for path in shot[0].paths)
    assert not cameras.unregistered
    assert not cameras.metric
    assert not cameras.still
    assert job.metrics["registered"] == job.metrics["photos"] == 16
    assert 0.05 < job.metrics["reprojection_px"] < 0.6
    centers, truth = cameras.world_from_cam[:, :3, 3], shot[1][:, :3, 3]
    scale, transform = fit_similarity(centers, truth)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)
    assert np.median(error) < 2e-3  # at 1 m and 1.9 mm per pixel
    assert_allclose(cameras.intrinsics[0].fx, 528.0, rtol=0.01, atol=0)  # focal length is refined, from 16 photos


def test_cameras_are_not_adjusted_to_more_points_when_that_is_not_asked(shot):
    """The coarsest level of a run with a time budget: cameras are found all the same, less well."""
    job = Job()
    cameras, _ = estimate_cameras(shot[0], SfmConfig.model_validate(LEVELS["sfm"][-1].settings), job)
    assert not cameras.unregistered
    assert "tracked_points" not in job.metrics
    assert [what for what, _ in job.left_out] == ["an adjustment to more points than features"]
    centers, truth = cameras.world_from_cam[:, :3, 3], shot[1][:, :3, 3]
    scale, transform = fit_similarity(centers, truth)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)
    assert 1e-4 < np.median(error) < 4e-3  # at 1 m; twice what is asked of the default


@pytest.mark.parametrize(("enough_features", "fixed_camera", "ways"), [(50, False, 2), (50, True, 2), (500, False, 1)])
def test_the_board_is_looked_for_once_whatever_is_tried(shot, monkeypatch, enough_features, fixed_camera, ways):
    """By usual features, then by faint ones, in all of the photo or beside its background; or by faint ones alone."""
    taken, tried, looked = PhotoSet(shot[0].paths, shot[0].intrinsics, BOARD), [], []
    none = [(np.empty(0, np.int32), np.empty((0, 2)))] * len(taken.paths)
    monkeypatch.setattr(sfm_module, "detect", lambda photos, *args: [60] * len(photos.paths))
    monkeypatch.setattr(sfm_module, "match", lambda *args, **named: (0, fixed_camera))
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: tried.append(args))
    monkeypatch.setattr(sfm_module, "map_from_board", lambda *args: None)
    monkeypatch.setattr(sfm_module, "detect_board", lambda *args: looked.append(args) or none)
    with pytest.raises(ScanError, match="fewer than 3 of 16"):
        estimate_cameras(taken, SfmConfig(enough_features=enough_features), Job())
    assert (len(tried), len(looked)) == (ways, 1)


def test_first_camera_is_in_front_and_up_is_up(sparse):
    cameras, cloud, _ = sparse
    assert cameras.world_from_cam[0, 2, 3] > abs(cameras.world_from_cam[0, 0, 3])
    assert (cameras.world_from_cam[:, 1, 3] > np.median(cloud.points[:, 1])).all()
    assert (cameras.world_from_cam[:, 1, 1] < 0).all()  # the picture's down is the world's down


def test_normals_of_sparse_points_face_their_cameras(sparse):
    cameras, cloud, _ = sparse
    towards = cameras.world_from_cam[:, :3, 3][:, None] - cloud.points
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    facing = (towards * cloud.normals).sum(2).max(0)
    assert (facing > 0.3).all()  # a point of the board that all see has its normal straight up
    assert np.median(facing) > 0.9


def test_two_runs_give_the_same_bits(sparse, shot):
    again, cloud = estimate_cameras(shot[0], SfmConfig(), Job())
    assert again.world_from_cam.tobytes() == sparse[0].world_from_cam.tobytes()
    assert cloud.points.tobytes() == sparse[1].points.tobytes()
    assert again.intrinsics == sparse[0].intrinsics


def test_board_gives_metres_and_the_floor(sparse, shot, scene):
    job = Job()
    cameras, cloud = apply_board(shot[0], *sparse[:2], ScaleConfig(), job)
    assert cameras.metric
    assert not job.warnings
    scale, _ = fit_similarity(cameras.world_from_cam[:, :3, 3], shot[1][:, :3, 3])
    assert_allclose(scale, 1.0, rtol=3e-3, atol=0)  # the promise of the scale: 0.3 %
    error = np.linalg.norm(cameras.world_from_cam[:, :3, 3] - shot[1][:, :3, 3], axis=1)
    assert np.median(error) < 3e-3  # absolute: the board's frame is the scene's
    on_tube = cloud.points[cloud.points[:, 1] > 0.1]
    assert np.median(distances(scene, on_tube)) < 1e-3
    assert 0 < job.metrics["scale_error_percent"] < 0.3
    assert job.metrics["board_corners"] > 20


def test_without_a_board_the_scan_stays_without_scale(sparse, shot):
    job = Job()
    cameras, cloud = apply_scale(replace(shot[0], board=None), *sparse[:2], ScaleConfig(), job)
    assert cameras is sparse[0]
    assert cloud is sparse[1]
    assert "no scale" in job.notes[0]
    assert "scale_source" not in job.metrics


def test_wrong_board_warns_and_leaves_the_scale_alone(sparse, shot):
    job = Job()
    wrong = replace(shot[0].board, dictionary="DICT_6X6_50")
    cameras, _ = apply_board(replace(shot[0], board=wrong), *sparse[:2], ScaleConfig(), job)
    assert not cameras.metric
    assert "board.yaml" in job.warnings[0]


def test_corners_on_one_line_fix_no_floor(sparse, shot, true_cameras, monkeypatch):
    """The board could be turned about that line. The corners are projected here, so that they are exact."""
    row = board_corners(shot[0].board)[:8]
    seen = []
    for pose in shot[1]:
        local = (row - pose[:3, 3]) @ pose[:3, :3]
        seen.append((np.arange(8, dtype=np.int32), 528 * local[:, :2] / local[:, 2:] + [239.5, 179.5]))
    monkeypatch.setattr(scale_module, "detect_board", lambda *args: seen)
    job = Job()
    cameras, _ = apply_board(shot[0], true_cameras, sparse[1], ScaleConfig(), job)
    assert cameras is true_cameras
    assert "one line" in job.warnings[0]


@pytest.mark.slow
def test_a_faint_print_is_placed_by_fainter_features_where_the_usual_ones_place_few(tmp_path):
    """A moving camera, a plain floor, and a quarter of the usual contrast: some 70 features a photo, and no pair.

    So few points fit a lens that bends by 13 % at the corners, with a focal length 14 % too long.
    """
    poses, job = orbit(24, elevations_deg=(15.0,)), Job()
    faint = make_scene(contrast=0.25)
    faint.floor[:] = 150
    found = photos(faint, tmp_path / "faint", poses, Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5), board=False)
    cameras, _ = estimate_cameras(found, SfmConfig(enough_features=50), job)
    assert any("fainter" in note for note in job.notes)
    assert len(cameras.names) == len(poses)
    centers, truth = cameras.world_from_cam[:, :3, 3], poses[:, :3, 3]
    scale, transform = fit_similarity(centers, truth)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)
    assert np.median(error) < 1e-2  # at 1 m and 1.9 mm per pixel
    assert any("straight" in note for note in job.notes)
    assert abs(cameras.intrinsics[0].k1) < 0.05  # it moves the corners by 1 %
    assert_allclose(cameras.intrinsics[0].fx, 528.0, rtol=0.02, atol=0)  # known from 1,400 points


def test_a_lens_that_bends_is_found_where_photos_need_it(shot, tmp_path):
    """The photos resampled as a lens with k1 = -0.3 shows them: it moves the corners by 10 %."""
    truth = shot[0].intrinsics[0]
    v, u = np.mgrid[: truth.height, : truth.width]
    bent = np.stack([(u - truth.cx) / truth.fx, (v - truth.cy) / truth.fy], axis=-1)
    flat = bent.copy()
    for _ in range(30):  # x (1 + k1 r²) = bent
        flat = bent / (1.0 - 0.3 * (flat**2).sum(axis=-1, keepdims=True))
    place = (flat * truth.fx + [truth.cx, truth.cy]).astype(np.float32)
    paths = []
    for path in shot[0].paths:
        picture = cv2.remap(cv2.imread(str(path)), place[..., 0], place[..., 1], cv2.INTER_CUBIC)
        paths.append(tmp_path / path.name)
        cv2.imwrite(str(paths[-1]), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    cameras, _ = estimate_cameras(PhotoSet(tuple(paths), shot[0].intrinsics), SfmConfig(), Job())
    assert len(cameras.names) == len(paths)
    assert_allclose(cameras.intrinsics[0].k1, -0.3, rtol=0, atol=0.02)  # 2 % of it move a corner by 0.1 px
    assert_allclose(cameras.intrinsics[0].fx, truth.fx, rtol=0.01, atol=0)  # as without a bend
    centers, right = cameras.world_from_cam[:, :3, 3], shot[1][:, :3, 3]
    scale, transform = fit_similarity(centers, right)
    error = np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - right, axis=1)
    assert error.max() < 3e-3  # at 1 m and 1.9 mm per pixel; a lens as bent, with too few ties, was 0.5 m off


def grey_photos(folder, count, values):
    paths = []
    for k in range(count):
        paths.append(folder / f"grey{k}.png")
        cv2.imwrite(str(paths[-1]), np.full((120, 160, 3), values[k % len(values)], np.uint8))
    return PhotoSet(tuple(paths), (None,) * count)


def test_plain_photos_are_refused_with_counts_and_advice(tmp_path):
    with pytest.raises(ScanError, match="grey1.png 0") as caught:
        estimate_cameras(grey_photos(tmp_path, 4, (90, 130)), SfmConfig(), Job())
    assert "texture" in caught.value.hint


@pytest.mark.parametrize(("turned", "kept"), [(0.0, 1), (0.15, 1), (0.5, 0)])
def test_a_pair_whose_matches_contradict_each_other_is_dropped(tmp_path, turned, kept):
    """A right part of the second picture is turned by 25 degrees, which no geometry explains together with the rest."""
    noise = np.random.default_rng(6).normal(size=(480, 640)).astype(np.float32)
    first = np.clip(128 + 40 * sum(cv2.GaussianBlur(noise, (0, 0), s) * s for s in (2, 5)), 0, 255).astype(np.uint8)
    second = first.copy()
    if turned:
        left = round(640 * (1 - turned))
        turn = cv2.getRotationMatrix2D(((640 + left) / 2, 240), 25, 1.0)
        second[:, left:] = cv2.warpAffine(first, turn, (640, 480), flags=cv2.INTER_CUBIC)[:, left:]
    paths = tmp_path / "a.png", tmp_path / "b.png"
    for path, picture in zip(paths, (first, second), strict=True):
        cv2.imwrite(str(path), picture)
    found, database = PhotoSet(paths, (None, None)), tmp_path / "x.db"
    assert min(detect(found, database, SURE, FeatureConfig())) > 500
    assert match(found, database, FeatureConfig(), Job()).pairs == kept


@pytest.mark.parametrize("copies", [2, 5])
def test_photos_from_one_place_are_refused(shot, tmp_path, copies):
    picture = shot[0].paths[0].read_bytes()
    paths = []
    for k in range(copies):
        paths.append(tmp_path / f"same{k}.jpg")
        paths[-1].write_bytes(picture)
    with pytest.raises(ScanError, match="fewer than 3 of .* photos could be placed|sparse point"):
        estimate_cameras(PhotoSet(tuple(paths), shot[0].intrinsics[:copies]), SfmConfig(), Job())


def test_copy_of_a_database_has_what_is_still_in_the_log(tmp_path):
    with closing(sqlite3.connect(tmp_path / "sure.db")) as writer:
        writer.execute("pragma journal_mode=wal")
        writer.execute("create table matches (pair integer)")
        writer.execute("insert into matches values (7)")
        writer.commit()
        with closing(sqlite3.connect(copy_database(tmp_path / "sure.db", "global"))) as reader:
            assert reader.execute("select pair from matches").fetchall() == [(7,)]
