"""Features of a background that stays, told from those of what turns: made-up places, and rendered photos."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pycolmap
import pytest
from scan_scene import make_scene, orbit, render

from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import PointCloud
from vto_pipeline.scan.grey import USUAL
from vto_pipeline.scan.photos import sfm
from vto_pipeline.scan.photos.consistency import moving, rays
from vto_pipeline.scan.photos.matching.features import FAINT, FeatureConfig, detect, match
from vto_pipeline.scan.photos.matching.fixed_camera import MOVING_SHARE, moving_matches, still_features
from vto_pipeline.scan.photos.matching.mapping import map_photos
from vto_pipeline.scan.photos.matching.still_background import paint_over, still_pixels
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.photos.stereo import StereoConfig, estimate_depth_maps
from vto_pipeline.scan.similarity import fit_similarity

PHOTOS, OBJECT, WALL = 24, 60, 90
PHOTO = Intrinsics(480, 360, 528.0, 528.0, 239.5, 179.5)


def turning(fixed: bool, seed=0):
    """Places (K, 2) and matches: an object that turns by 15 degrees a photo, seen for 75, before a wall."""
    random = np.random.default_rng(seed)
    angle, height = random.uniform(0, 2 * np.pi, OBJECT), random.uniform(100, 500, OBJECT)
    wall = random.uniform([0, 0], [800, 600], (WALL, 2))
    places, seen = {}, {}
    for photo in range(PHOTOS):
        turn = angle + 2 * np.pi * photo / PHOTOS
        on_object = np.stack([400 + 150 * np.sin(turn), height], axis=1)
        shift = 0 if fixed else 60.0 * photo
        places[f"{photo}"] = np.concatenate([on_object, wall + np.array([shift, 0])]) + random.normal(
            0, 0.3, (OBJECT + WALL, 2)
        )
        hidden = (np.abs(wall[:, 0] - 400) < 150) & (np.abs(wall[:, 1] - 300) < 200)
        seen[f"{photo}"] = np.concatenate([np.cos(turn) > np.cos(np.radians(37)), ~hidden])
    matches = {}
    for one in range(PHOTOS):
        for other in range(one + 1, PHOTOS):
            both = np.flatnonzero(seen[f"{one}"] & seen[f"{other}"])
            matches[f"{one}", f"{other}"] = np.stack([both, both], axis=1).astype(np.uint32)
    return places, matches


def test_the_wall_behind_a_turntable_is_found_and_the_object_is_not():
    places, matches = turning(fixed=True)
    found = still_features(places, matches, 800)
    assert found.fixed_camera
    used = {name: np.zeros(OBJECT + WALL, bool) for name in places}
    for (one, other), rows in matches.items():
        used[one][rows[:, 0]] = used[other][rows[:, 1]] = True
    for name, still in found.still.items():
        assert still[OBJECT:][used[name][OBJECT:]].all()
        assert not still[:OBJECT].any()
    left = moving_matches(places, matches, found.still, 800)
    assert set(left) == set(matches)
    for rows in left.values():
        assert (rows < OBJECT).all()
    assert sum(map(len, left.values())) > 0.9 * sum((rows < OBJECT).all(axis=1).sum() for rows in matches.values())


def test_a_camera_that_moves_is_not_called_fixed():
    places, matches = turning(fixed=False)
    found = still_features(places, matches, 800)
    assert not found.fixed_camera
    assert found.share == 0.0


def on_turntable(scene, folder, count=24):
    """Photos of the tube from a ring, with what lies round it replaced by one picture that never changes."""
    folder.mkdir()
    random = np.random.default_rng(3)
    grain = sum(cv2.GaussianBlur(random.normal(size=(360, 480, 3)), (0, 0), s) * s for s in (1.5, 4, 10))
    wall = np.clip(120 + 25 * grain, 0, 255)
    poses, paths = orbit(count, elevations_deg=(12.0,)), []
    for number, pose in enumerate(poses):
        color, depth = render(scene, PHOTO, pose)
        points = (rays(PHOTO.matrix, 360, 480) * depth[..., None]) @ pose[:3, :3].T + pose[:3, 3]
        tube = (depth > 0) & (points[..., 1] > 0.01)
        picture = np.where(tube[..., None], color, wall) + random.normal(0, 1.5, color.shape)
        paths.append(folder / f"{number:03d}.jpg")
        cv2.imwrite(
            str(paths[-1]), np.clip(picture, 0, 255).astype(np.uint8)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 94]
        )
    return PhotoSet(tuple(paths), (PHOTO,) * count), poses


def test_photos_from_a_turntable_are_placed_round_the_object(scene, tmp_path):
    photos, poses = on_turntable(scene, tmp_path / "photos")
    job = Job()
    cameras, _ = estimate_cameras(photos, SfmConfig(), job)
    assert job.metrics["still_share"] > 0.2
    assert cameras.still
    assert len(cameras.names) == len(poses)
    scale, motion = fit_similarity(cameras.world_from_cam[:, :3, 3], poses[:, :3, 3])
    off = scale * cameras.world_from_cam[:, :3, 3] @ motion[:3, :3].T + motion[:3, 3] - poses[:, :3, 3]
    assert np.median(np.linalg.norm(off, axis=1)) < 5e-3  # at 1 m and 1.9 mm per pixel


def test_the_pixels_that_stay_are_the_background_and_not_the_object(scene, tmp_path):
    photos, poses = on_turntable(scene, tmp_path / "photos", count=8)
    masks = still_pixels(photos)
    assert masks is not None
    for mask, pose in zip(masks, poses, strict=True):
        _, depth = render(scene, PHOTO, pose, samples=1)
        points = (rays(PHOTO.matrix, 360, 480) * depth[..., None]) @ pose[:3, :3].T + pose[:3, 3]
        tube = (depth > 0) & (points[..., 1] > 0.01)
        assert mask[tube].mean() < 0.001
        assert mask[~tube].mean() > 0.8  # what the tube crosses in half of the photos is not known


def test_photos_that_differ_in_size_are_not_compared(tmp_path):
    paths = tuple(tmp_path / f"{k}.png" for k in range(3))
    for k, path in enumerate(paths):
        cv2.imwrite(str(path), np.full((60, 80 + k, 3), 90, np.uint8))
    assert still_pixels(PhotoSet(paths, (None,) * 3)) is None


def test_a_faint_object_has_features_once_the_strong_wall_is_painted_over(tmp_path):
    """As many as are kept, the largest first, are mostly the wall's; over paint there are none."""
    photos, poses = on_turntable(make_scene(contrast=0.2), tmp_path / "photos", count=8)
    masks = still_pixels(photos)
    assert masks is not None
    (tmp_path / "painted").mkdir()
    painted = paint_over(photos, masks, np.array(USUAL), tmp_path / "painted")
    on_tube, beside = [], []
    for number, name in enumerate(("photos", "painted")):
        shown = PhotoSet((photos, painted)[number].paths[:2], photos.intrinsics[:2])
        database = tmp_path / f"{name}.db"
        detect(shown, database, FAINT, FeatureConfig(max_features=600))
        with pycolmap.Database.open(str(database)) as opened:
            place = opened.read_keypoints(1)[:, :2].astype(int)
        _, depth = render(make_scene(), PHOTO, poses[0], samples=1)
        points = (rays(PHOTO.matrix, 360, 480) * depth[..., None]) @ poses[0][:3, :3].T + poses[0][:3, 3]
        tube = cv2.dilate(((depth > 0) & (points[..., 1] > 0.01)).astype(np.uint8), np.ones((9, 9)))
        inside = tube[place[:, 1].clip(0, 359), place[:, 0].clip(0, 479)] > 0
        on_tube.append(int(inside.sum()))
        beside.append(int((~inside).sum()))
    assert on_tube[1] > 2 * on_tube[0]
    assert beside[1] < 0.2 * beside[0]


@pytest.mark.parametrize("stays", [True, False])
def test_where_the_camera_is_known_to_stay_no_match_stays_in_its_place(tmp_path, stays):
    """Few specks of a wall are left under the paint: fewer than tell by themselves that the camera did not move."""
    rng = np.random.default_rng(0)
    specks, moving = (
        cv2.resize(rng.integers(60, 200, (20, wide)).astype(np.uint8), None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC)
        for wide in (10, 60)
    )
    paths = tuple(tmp_path / f"{k}.png" for k in range(4))
    for k, path in enumerate(paths):
        picture = np.full((360, 480), 128, np.uint8)
        picture[10:170, 10:90] = specks
        picture[180:340, 20:440] = moving[:, 15 * k : 15 * k + 420]
        cv2.imwrite(str(path), picture)
    photos, database, config = PhotoSet(paths, (None,) * 4), tmp_path / "photos.db", FeatureConfig()
    detect(photos, database, FAINT, config)
    match(photos, database, config, Job(), camera_stays=stays)
    moved = []
    with pycolmap.Database.open(str(database)) as opened:
        for pair, found in zip(*opened.read_two_view_geometries(), strict=True):
            one, other = (opened.read_keypoints(number)[:, :2] for number in pycolmap.pair_id_to_image_pair(pair))
            rows = found.inlier_matches
            moved += list(np.linalg.norm(one[rows[:, 0]] - other[rows[:, 1]], axis=1))
    assert sum(way > 10 for way in moved) > 100
    assert (min(moved) > 2.5) == stays


def test_photos_that_fail_before_their_background_are_placed_beside_it(scene, tmp_path, monkeypatch):
    photos, poses = on_turntable(scene, tmp_path / "photos")
    photos, poses, job = PhotoSet(photos.paths[:6], photos.intrinsics[:6]), poses[:6], Job()
    folders = []

    def fails_first(database, *rest):
        folders.append(database.parent.name)
        return map_photos(database, *rest) if len(folders) > 1 else None

    monkeypatch.setattr(sfm, "map_photos", fails_first)
    cameras, _ = estimate_cameras(photos, SfmConfig(), job)
    assert folders[1:] == ["beside"]
    assert job.metrics["still_share"] > 0.2
    assert job.metrics["background_share"] > 0.3
    assert len(cameras.names) == len(poses)
    scale, motion = fit_similarity(cameras.world_from_cam[:, :3, 3], poses[:, :3, 3])
    off = scale * cameras.world_from_cam[:, :3, 3] @ motion[:3, :3].T + motion[:3, 3] - poses[:, :3, 3]
    assert np.median(np.linalg.norm(off, axis=1)) < 1e-2  # at 1 m and 1.9 mm per pixel


@pytest.mark.parametrize(
    ("again", "before", "by_board", "believed"),
    [
        (12, None, False, False),
        (17, None, False, False),
        (18, None, False, True),
        (24, 20, False, True),
        (20, 20, False, False),
        (None, None, False, False),
        (12, None, True, True),
        (12, 12, True, False),
    ],
)
def test_a_second_model_is_believed_where_it_places_most_photos_and_more_than_the_first(
    again, before, by_board, believed
):
    again, before = (n and SimpleNamespace(num_reg_images=lambda n=n: n) for n in (again, before))
    second = sfm._Tried(again, [70] * PHOTOS, 9, by_board)
    assert sfm._is_better(second, sfm._Tried(before, [70] * PHOTOS, 9, by_board=False)) is believed


def test_what_stays_in_its_place_is_told_from_what_turns():
    """Rays against a cylinder by formula; for the rest, where two rays through one pixel pass closest, 15° on."""
    poses, radius = orbit(24, elevations_deg=(0.0,)), 0.1
    way = rays(PHOTO.matrix, 360, 480) @ poses[0, :3, :3].T
    eye = poses[0, :3, 3]
    a, b = (way[..., [0, 2]] ** 2).sum(-1), (way[..., [0, 2]] * eye[[0, 2]]).sum(-1)
    root = b**2 - a * ((eye[[0, 2]] ** 2).sum() - radius**2)
    turns = root > 0
    near = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    others, depth = [1, 2, 22, 23], np.zeros((24, 360, 480), np.float32)
    beside = np.abs(np.arange(480) - 239.5) < 10  # farther from the axis, photos do not agree on it
    its, away = rays(PHOTO.matrix, 360, 480) @ poses[1, :3, :3].T, poses[1, :3, 3] - eye
    dot = (way * its).sum(-1)
    length = ((way @ away) * (its**2).sum(-1) - (its @ away) * dot) / ((way**2).sum(-1) * (its**2).sum(-1) - dot**2)
    for behind in (False, True):
        depth[0] = np.where(beside, length, 0.0) if behind else np.where(turns, near, 0.0)
        maps = DepthMaps(tuple(map(str, range(24))), (PHOTO,) * 24, poses, depth)
        found = moving(maps, 0, others, MOVING_SHARE * 480)
        assert not found[depth[0] == 0].any()
        share = found[depth[0] > 0].mean()
        assert share == 0.0 if behind else share > 0.99
    assert moving(maps, 0, [], 3.0).sum() == 0


def test_a_background_seen_through_a_gap_gets_no_depth(shot, true_cameras, scene, tmp_path):
    """A strip that is the same in all photos, before the tube's axis: matched with itself, it lies on the axis."""
    random, paths = np.random.default_rng(5), []
    strip = cv2.GaussianBlur(random.normal(size=(160, 24, 3)), (0, 0), 1.5) * 90 + 120
    for path in shot[0].paths:
        picture = cv2.imread(str(path))
        picture[100:260, 228:252] = np.clip(strip + random.normal(0, 1, strip.shape), 0, 255)
        paths.append(tmp_path / path.name)
        cv2.imwrite(str(paths[-1]), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    photos = PhotoSet(tuple(paths), shot[0].intrinsics)
    step = scene.vertices[::37]
    normals = step * [1, 0, 1] / np.linalg.norm(step * [1, 0, 1], axis=1, keepdims=True)
    cloud, config = PointCloud(step, normals), StereoConfig(rematch={"rounds": 0})
    shown = []
    for still in (False, True):
        maps = estimate_depth_maps(photos, replace(true_cameras, still=still), cloud, config, Job())
        shown.append((maps.depth > 0).sum(axis=0))
    in_strip, beside = (slice(110, 250), slice(232, 248)), (slice(110, 250), slice(180, 220))
    assert shown[0][in_strip].mean() > 2.0
    assert shown[1][in_strip].mean() < 0.1 * shown[0][in_strip].mean()  # some of it was matched with the tube beside
    assert shown[1][beside].mean() > 0.98 * shown[0][beside].mean()
