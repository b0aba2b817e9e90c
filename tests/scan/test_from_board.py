"""Photos placed by the board alone, by it and by features, or not at all: exact projections and a rendered scene."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pycolmap
import pytest
from numpy.testing import assert_allclose
from scan_scene import BOARD, make_scene, orbit, photos

from vto_pipeline.errors import ScanError
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.numerics.srgb import encode_srgb
from vto_pipeline.scan.photos import sfm as sfm_module
from vto_pipeline.scan.photos.board import board_corners, detect_board
from vto_pipeline.scan.photos.matching import from_board as from_board_module
from vto_pipeline.scan.photos.matching.board_poses import Placed, epipolar_lines, place_photos
from vto_pipeline.scan.photos.matching.features import SURE, FeatureConfig, detect, match
from vto_pipeline.scan.photos.matching.from_board import map_from_board
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras, load_colmap
from vto_pipeline.scan.similarity import fit_similarity

LENS = Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)
GUESSED = replace(LENS, fx=545.0, fy=545.0)
"""What EXIF says: 3 % too long."""


def project(points, pose, lens):
    """Pixels (N, 2) of points by the formulas of a pinhole camera with one radial term."""
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    flat = local[:, :2] / local[:, 2:]
    bent = flat * (1 + lens.k1 * (flat**2).sum(1, keepdims=True))
    return bent * [lens.fx, lens.fy] + [lens.cx, lens.cy]


def sighted(poses, lens, ids, noise=0.0):
    random = np.random.default_rng(3)
    world = board_corners(BOARD)[ids]
    return {
        f"{k}": (np.array(ids, np.int32), project(world, pose, lens) + random.normal(0, noise, (len(ids), 2)))
        for k, pose in enumerate(poses)
    }


def colmap_camera(lens):
    params = [lens.fx, lens.cx + 0.5, lens.cy + 0.5, lens.k1]
    return pycolmap.Camera(model="SIMPLE_RADIAL", width=lens.width, height=lens.height, params=params)


def centers_off(centers, truth):
    """Distances of camera centres (C, 3) from the true ones after a similarity [m]."""
    scale, transform = fit_similarity(centers, truth)
    return np.linalg.norm(scale * centers @ transform[:3, :3].T + transform[:3, 3] - truth, axis=1)


def placed_centers(model, names):
    images = {image.name: image for image in model.images.values() if image.has_pose}
    return {name: np.array(images[name].projection_center()) for name in names if name in images}


@pytest.mark.parametrize("k1", [0.0, -0.15])
def test_focal_length_and_places_are_those_that_the_corners_were_projected_with(k1):
    """The bend is what is known of it: a few corners tell it too badly."""
    lens, poses = replace(LENS, k1=k1), orbit(8, distance=0.8)
    camera = colmap_camera(replace(GUESSED, k1=k1))
    placed = place_photos(camera, BOARD, sighted(poses, lens, range(48)))
    assert sorted(placed) == [f"{k}" for k in range(8)]
    assert_allclose(camera.params, [528.0, 240.0, 180.0, k1], rtol=1e-4, atol=1e-4)  # pixels in single precision
    for k, pose in enumerate(poses):
        mine = placed[f"{k}"]
        assert_allclose(mine.rotation, pose[:3, :3].T, rtol=0, atol=1e-4)
        assert_allclose(-mine.rotation.T @ mine.shift, pose[:3, 3], rtol=0, atol=2e-4)  # [m], for the same reason


def test_corners_that_are_elsewhere_are_left_out():
    found = sighted(orbit(6), LENS, range(24), noise=0.2)
    for ids, pixels in found.values():
        pixels[ids == 7] += [25.0, -14.0]
    placed = place_photos(colmap_camera(GUESSED), BOARD, found)
    assert len(placed) == 6
    assert all(not one.corners[7] and one.corners.sum() == 23 for one in placed.values())


@pytest.mark.parametrize(
    ("ids", "places"),
    [
        (range(8), False),  # one row: the board could turn about it
        ([*range(7), 8], False),  # all but one in a row
        (range(5), False),
        ([0, 1, 2, 8, 9, 10], True),
    ],
)
def test_a_photo_needs_corners_that_fix_it(ids, places):
    assert bool(place_photos(colmap_camera(LENS), BOARD, sighted(orbit(4), LENS, list(ids)))) is places


def test_a_photo_of_one_row_does_not_spoil_the_others():
    found = sighted(orbit(6), LENS, range(48))
    found["2"] = (found["2"][0][:8], found["2"][1][:8])
    assert sorted(place_photos(colmap_camera(LENS), BOARD, found)) == ["0", "1", "3", "4", "5"]


def test_the_same_corners_give_the_same_bits():
    """OpenCV's own threads may sum in any order."""
    found = sighted(orbit(20), LENS, range(48), noise=0.3)
    runs = set()
    for _ in range(40):
        placed = place_photos(colmap_camera(GUESSED), BOARD, found)
        runs.add(b"".join(one.rotation.tobytes() + one.shift.tobytes() for one in placed.values()))
    assert len(runs) == 1


def test_another_board_places_nothing():
    """Columns and rows exchanged: the corners carry other numbers."""
    other = replace(BOARD, columns=BOARD.rows, rows=BOARD.columns)
    assert place_photos(colmap_camera(LENS), other, sighted(orbit(6), LENS, range(48))) == {}


def test_distance_from_the_line_of_exact_matches_is_zero_and_of_shifted_ones_their_shift():
    poses = orbit(12)[[0, 1]]
    points = np.random.default_rng(4).uniform([-0.1, 0.15, -0.1], [0.1, 0.35, 0.1], (200, 3))
    lens = replace(LENS, k1=-0.1)
    first, second = (Placed(pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3], np.ones(6, dtype=bool)) for pose in poses)
    here, there = (project(points, pose, lens) + 0.5 for pose in poses)
    camera = colmap_camera(lens)

    def off(here, there):
        lines = epipolar_lines(camera, camera, first, second, here, there, 5.28)
        assert_allclose(lines.most, 0.01, rtol=1e-12, atol=0)
        slope = np.sqrt((lines.line[:, :2] ** 2).sum(axis=1) + (lines.line_back[:, :2] ** 2).sum(axis=1))
        return 528.0 * np.abs((lines.line * lines.ray).sum(axis=1)) / slope

    assert off(here, there).max() < 1e-6
    up = there + np.array([0.0, 4.0])  # the cameras are beside each other: lines are all but level
    assert_allclose(off(here, up), 4.0 / np.sqrt(2.0), rtol=0.1, atol=0)  # either point may give way
    assert len(off(here[:0], there[:0])) == 0


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Ten photos of a tube without a print, of which no feature was matched."""
    folder, poses = tmp_path_factory.mktemp("plain"), orbit(10, elevations_deg=(28.0,))
    load_colmap(0)
    shot = photos(make_scene(contrast=0.0), folder / "photos", poses, LENS)
    shot = PhotoSet(shot.paths, (GUESSED,) * len(poses), shot.board)
    detect(shot, folder / "x.db", SURE, FeatureConfig())
    names = tuple(path.name for path in shot.paths)
    return shot, poses, folder / "x.db", dict(zip(names, detect_board(shot, names, Job()), strict=True))


def test_the_board_alone_places_photos(plain):
    shot, poses, database, found = plain
    job = Job()
    model = map_from_board(database, shot.paths[0].parent, BOARD, found, job)
    centers = placed_centers(model, sorted(found))
    assert list(centers) == sorted(found)
    error = centers_off(np.array(list(centers.values())), poses[:, :3, 3])
    assert error.max() < 0.02  # at 1 m: one flat board, all from one height, tells focal length to 2 %, and so depth
    assert_allclose(next(iter(model.cameras.values())).focal_length, 528.0, rtol=0.02, atol=0)
    assert job.metrics["board_placed"] == 10


def test_points_are_as_far_off_as_the_placed_cameras_show_them(plain, tmp_path, monkeypatch):
    """COLMAP goes nowhere from the board: the errors of points are those of the last adjustment, not of the start."""
    shot, _, database, found = plain
    copied = tmp_path / database.name
    copied.write_bytes(database.read_bytes())
    monkeypatch.setattr(from_board_module, "incremental", lambda *given, **named: [])
    model = map_from_board(copied, shot.paths[0].parent, BOARD, found, Job())
    off = []
    for point in model.points3D.values():
        shown = []
        for element in point.track.elements:
            image = model.images[element.image_id]
            pose = np.vstack([image.cam_from_world().inverse().matrix(), [0.0, 0.0, 0.0, 1.0]])
            focal, cx, cy, k1 = image.camera.params
            lens = replace(LENS, fx=focal, fy=focal, cx=cx, cy=cy, k1=k1)
            shown.append(project(point.xyz[None], pose, lens)[0] - image.point2D(element.point2D_idx).xy)
        off.append(np.linalg.norm(shown, axis=1).mean())
    assert len(off) > 40
    assert_allclose([point.error for point in model.points3D.values()], off, rtol=0, atol=1e-9)


def test_fewer_corners_than_features_would_be_asked_for_place_photos(plain, tmp_path):
    """Sixteen in each photo: as many features might agree by chance."""
    shot, poses, database, found = plain
    copied = tmp_path / database.name
    copied.write_bytes(database.read_bytes())
    few = {name: (ids[:16], pixels[:16]) for name, (ids, pixels) in found.items()}
    model = map_from_board(copied, shot.paths[0].parent, BOARD, few, Job())
    centers = placed_centers(model, sorted(found))
    assert len(centers) == 10
    assert centers_off(np.array(list(centers.values())), poses[:, :3, 3]).max() < 0.05  # at 1 m, by a third of it


def test_matches_that_contradict_where_the_photos_were_do_not_count(plain, tmp_path):
    """Features paired at random. They lie within some 90 pixels of height: by chance a fifth is near its line."""
    shot, _, database, found = plain
    copied = tmp_path / database.name
    copied.write_bytes(database.read_bytes())
    with pycolmap.Database.open(str(copied)) as opened:
        one, other = (len(opened.read_keypoints(number)) for number in (1, 2))
        random = np.random.default_rng(8)
        rows = [random.permutation(count)[: min(one, other)] for count in (one, other)]
        opened.write_matches(1, 2, np.column_stack(rows).astype(np.uint32))
    map_from_board(copied, shot.paths[0].parent, BOARD, found, Job())
    with pycolmap.Database.open(str(tmp_path / "board" / database.name)) as opened:
        kept = np.array(opened.read_two_view_geometry(1, 2).inlier_matches)
    corners = (kept >= [one, other]).all(axis=1)
    names = sorted(found)
    assert corners.sum() == len(np.intersect1d(found[names[0]][0], found[names[1]][0]))
    assert min(one, other) > 100
    assert (~corners).sum() < 0.3 * min(one, other)


def test_features_tie_photos_without_the_board_to_the_others(shot, tmp_path):
    """Two photos do not show the board, and one shows nothing at all."""
    taken, poses = shot
    paths = []
    for k, path in enumerate(taken.paths):
        picture = cv2.imread(str(path))
        if k in (4, 9):
            picture[(np.arange(360) > 190)[:, None] & (picture.std(axis=2) < 4)] = 150  # the floor is grey
        if k == 12:
            picture[:] = 150
        paths.append(tmp_path / path.name)
        cv2.imwrite(str(paths[-1]), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    own = PhotoSet(tuple(paths), taken.intrinsics, taken.board)
    names = tuple(path.name for path in paths)
    found = dict(zip(names, detect_board(own, names, Job()), strict=True))
    for k in (4, 9):
        found[names[k]] = (found[names[k]][0][:0], found[names[k]][1][:0])
    detect(own, tmp_path / "x.db", SURE, FeatureConfig())
    match(own, tmp_path / "x.db", FeatureConfig(), Job())
    job = Job()
    model = map_from_board(tmp_path / "x.db", tmp_path, BOARD, found, job)
    centers = placed_centers(model, names)
    assert sorted(centers) == sorted(set(names) - {names[12]})
    truth = np.array([poses[names.index(name), :3, 3] for name in centers])
    error = centers_off(np.array(list(centers.values())), truth)
    assert error.max() < 5e-3
    assert job.metrics["board_placed"] == 13
    assert "features tie 2" in job.notes[-1]


def test_too_few_photos_with_the_board_place_none(plain, tmp_path):
    shot, _, database, found = plain
    copied = tmp_path / database.name
    copied.write_bytes(database.read_bytes())
    two = {name: found[name] for name in sorted(found)[:2]}
    job = Job()
    assert map_from_board(copied, shot.paths[0].parent, BOARD, two, job) is None
    assert "board.yaml" in job.notes[0]


def test_photos_that_features_do_not_place_are_placed_by_the_board(plain, monkeypatch):
    shot, poses, _, _ = plain
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: None)
    runs = []
    for _ in range(2):
        job = Job()
        runs.append(estimate_cameras(shot, SfmConfig(), job))
    cameras, cloud = runs[0]
    assert not cameras.unregistered
    error = centers_off(cameras.world_from_cam[:, :3, 3], poses[:, :3, 3])
    assert error.max() < 0.02
    assert cameras.world_from_cam.tobytes() == runs[1][0].world_from_cam.tobytes()
    assert cloud.points.tobytes() == runs[1][1].points.tobytes()


def test_where_the_board_places_all_photos_features_are_sought_along_its_lines_only(shot, monkeypatch):
    """They tie the photos on the print, too: 48 corners alone would leave them further off."""
    taken, poses = shot
    monkeypatch.setattr(sfm_module, "match", lambda *args, **named: pytest.fail("all features were matched"))
    job = Job()
    cameras, cloud = estimate_cameras(taken, SfmConfig(enough_features=20_000), job)
    assert not cameras.unregistered
    assert [what for what, _ in job.left_out] == ["matching the features of all photos"]
    assert centers_off(cameras.world_from_cam[:, :3, 3], poses[:, :3, 3]).max() < 2e-3  # at 1 m
    assert len(cloud.points) > 10 * len(board_corners(BOARD))


@pytest.mark.parametrize(("least", "refused"), [(0.5, True), (0.3, False)])
def test_where_most_photos_have_no_place_the_scan_ends_with_their_names(plain, monkeypatch, least, refused):
    shot, _, _, found = plain
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: None)
    every = [(ids[:3], pixels[:3]) if k < 6 else (ids, pixels) for k, (ids, pixels) in enumerate(found.values())]
    monkeypatch.setattr(sfm_module, "detect_board", lambda *args: every)
    monkeypatch.setattr(sfm_module, "adjust", lambda model, *args: None if refused else model)
    config = SfmConfig(min_placed=least, max_camera_px=100.0)
    if not refused:
        assert len(estimate_cameras(shot, config, Job())[0].names) == 4
        return
    with pytest.raises(ScanError, match="only 4 of 10 photos could be placed") as ended:
        estimate_cameras(shot, config, Job())
    named = [path.name for path in shot.paths if f"{path.name} (" in ended.value.problem]
    assert named == [path.name for path in shot.paths[:6]]
    assert "3 corners of the board" in ended.value.problem
    assert "4 of 10 photos show 6 or more corners of the board" in ended.value.hint


@pytest.mark.parametrize("hidden", [2, 8])
def test_photos_that_hardly_show_the_board_are_told_so(plain, monkeypatch, hidden):
    """The advice for photos with too little texture is of no use where the board is what places them."""
    shot, _, _, found = plain
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: None)
    every = [(ids[:3], pixels[:3]) if k < hidden else (ids, pixels) for k, (ids, pixels) in enumerate(found.values())]
    monkeypatch.setattr(sfm_module, "detect_board", lambda *args: every)
    job = Job()
    if hidden == 8:
        with pytest.raises(ScanError) as refused:
            estimate_cameras(shot, SfmConfig(), job)
        said = refused.value.hint
    else:
        cameras, _ = estimate_cameras(shot, SfmConfig(), job)
        assert set(cameras.unregistered) <= {path.name for path in shot.paths[:hidden]}  # features may tie one of them
        assert cameras.unregistered
        assert all("3 corners of the board" in why for why in job.metrics["left_out_photos"].values())
        said = job.warnings[0]
    assert f"{10 - hidden} of 10 photos show 6 or more corners of the board" in said


def test_without_a_board_or_with_another_nothing_changes(plain, monkeypatch):
    shot = plain[0]
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: None)
    for board in (None, replace(BOARD, dictionary="DICT_6X6_50")):
        with pytest.raises(ScanError, match="fewer than 3 of 10"):
            estimate_cameras(PhotoSet(shot.paths, shot.intrinsics, board), SfmConfig(), Job())


def test_a_board_seen_at_a_slant_is_found_where_it_is(tmp_path):
    """From 1 m and 8 degrees above the tube's middle a square is 21 by 7 pixels: hardly a marker can be read."""
    poses = orbit(4, elevations_deg=(8.0,))
    far = photos(make_scene(contrast=0.0), tmp_path, poses, LENS)
    found = detect_board(far, tuple(path.name for path in far.paths), Job())
    for (ids, pixels), pose in zip(found, poses, strict=True):
        assert len(ids) > 20  # of 48, some of them behind the tube; read marker by marker, none or two
        error = np.linalg.norm(pixels - project(board_corners(BOARD)[ids], pose, LENS), axis=1)
        assert np.median(error) < 0.3


@pytest.mark.parametrize(("corners", "enough"), [(range(16), True), ([0, 1, 2, 8, 9, 10], False)])
def test_cameras_that_so_few_corners_leave_uncertain_are_refused(plain, monkeypatch, corners, enough):
    """Six corners of a far board's edge alone: photos then lie 70 mm from the truth, at 1 m."""
    shot, poses, _, found = plain
    monkeypatch.setattr(sfm_module, "map_photos", lambda *args: None)
    few = [(ids[np.isin(ids, corners)], pixels[np.isin(ids, corners)]) for ids, pixels in found.values()]
    monkeypatch.setattr(sfm_module, "detect_board", lambda *args: few)
    job = Job()
    if enough:
        cameras, _ = estimate_cameras(shot, SfmConfig(), job)
        assert centers_off(cameras.world_from_cam[:, :3, 3], poses[:, :3, 3]).max() < 0.02
        assert 0.5 < job.metrics["camera_uncertainty_px"] < 2.0
        return
    monkeypatch.setattr(from_board_module, "match_placed", lambda *args: {})
    with pytest.raises(ScanError, match="the cameras are uncertain") as refused:
        estimate_cameras(shot, SfmConfig(), job)
    assert refused.value.hint == sfm_module.ADVICE
    cameras, _ = estimate_cameras(shot, SfmConfig(max_camera_px=100.0), Job())
    placed = [k for k, path in enumerate(shot.paths) if path.name in cameras.names]
    assert centers_off(cameras.world_from_cam[:, :3, 3], poses[placed, :3, 3]).max() > 0.04


@pytest.mark.parametrize("gain", [1.0, 2.0])
def test_a_small_board_that_a_lens_blurs_and_light_outshines_is_found_where_it_is(tmp_path, gain):
    """Blurred as light is, then encoded; at twice the exposure white is cut off. In levels, none of it can be read."""
    fine, square = 12, 13.0
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, BOARD.dictionary))
    pattern = cv2.aruco.CharucoBoard((BOARD.columns, BOARD.rows), BOARD.square_m, BOARD.marker_m, dictionary)
    printed = pattern.generateImage((BOARD.columns * 100, BOARD.rows * 100))
    turn, share = np.radians(10.0), square * fine / 100
    along, across = share * np.cos(turn), share * np.sin(turn)
    way = np.array([[along, -across, 900.0], [across, along, 500.0]])
    shown = cv2.warpAffine(printed, way, (400 * fine, 300 * fine), flags=cv2.INTER_AREA, borderValue=255)
    blurred = cv2.GaussianBlur(0.03 + 0.6 * shown / 255, (0, 0), 0.8 * fine)
    taken = blurred.reshape(300, fine, 400, fine).mean(axis=(1, 3))
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), encode_srgb(np.clip(gain * taken, 0, 1)))
    ids, pixels = detect_board(PhotoSet((path, path), (LENS, LENS), BOARD), ("a.png",), Job())[0]
    column, row = ids % (BOARD.columns - 1) + 1, ids // (BOARD.columns - 1) + 1
    true = np.column_stack([100.0 * column, 100.0 * row]) @ way[:, :2].T + way[:, 2]
    error = np.linalg.norm(pixels - ((true + 0.5) / fine - 0.5), axis=1)
    assert len(ids) > 20  # of 48
    assert np.median(error) < 0.3
