"""Photo sets as they come when something went wrong: each ends with a surface or with a reason, never a traceback."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
from PIL import Image
from scan_scene import Scene, look_at, photos

from vto_pipeline.errors import ScanError, VtoError
from vto_pipeline.io.captures.photos import read_photos
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import DepthMaps
from vto_pipeline.model.job import Job
from vto_pipeline.scan.fuse import FuseConfig, PhotoFuseConfig, check_coverage, fuse_depth_maps
from vto_pipeline.scan.library_message import library_message
from vto_pipeline.scan.photos.board import detect_board
from vto_pipeline.scan.photos.scale import ScaleConfig, apply_scale
from vto_pipeline.scan.photos.sfm import SfmConfig, estimate_cameras
from vto_pipeline.scan.photos.stereo import StereoConfig, estimate_depth_maps

BOARDS = "columns: 9\nrows: 7\nsquare_mm: 40\nmarker_mm: 30\n", "columns: 7\nrows: 7\nsquare_mm: 60\nmarker_mm: 45\n"
"""The one in the scene, and another."""
COUNT = 8


@pytest.fixture(scope="module")
def good(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Eight small photos along an arc, 14 degrees apart, as files."""
    camera, target = Intrinsics(320, 240, 352.0, 352.0, 159.5, 119.5), np.array([0, 0.24, 0])
    turns = np.radians(14.0) * np.arange(COUNT)
    poses = np.array([look_at(target + np.array([np.sin(t), 0.4, np.cos(t)]), target) for t in turns])
    return [path.read_bytes() for path in photos(scene, tmp_path_factory.mktemp("good"), poses, camera).paths]


def reconstruct(folder: Path, job: Job) -> int:
    """Take a folder all the way; the number of triangles."""
    found = read_photos(folder, job=job)
    cameras, cloud = apply_scale(found, *estimate_cameras(found, SfmConfig(), job), ScaleConfig(), job)
    maps = estimate_depth_maps(found, cameras, cloud, StereoConfig(), job)
    surface = fuse_depth_maps(found, cameras, maps, FuseConfig(), job)
    check_coverage(surface, maps, cloud, PhotoFuseConfig(), job)
    return len(surface.faces)


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def save(folder: Path, name: str, pixels: np.ndarray) -> None:
    cv2.imwrite(str(folder / name), pixels)


def black(folder, name, data, random):
    save(folder, name, np.zeros((240, 320, 3), np.uint8))


def noise(folder, name, data, random):
    save(folder, name, random.integers(0, 256, (240, 320, 3), dtype=np.uint8))


def unrelated(folder, name, data, random):
    save(folder, name, cv2.resize(random.integers(0, 256, (12, 16, 3), dtype=np.uint8), (320, 240)))


def truncated(folder, name, data, random):
    (folder / name).write_bytes(data[: random.integers(1, len(data))])


def damaged(folder, name, data, random):
    broken = bytearray(data)
    for place in random.integers(0, len(data), 20):
        broken[place] = random.integers(0, 256)
    (folder / name).write_bytes(bytes(broken))


def smaller(folder, name, data, random):
    save(folder, name, cv2.resize(decoded(data), None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA))


def cropped(folder, name, data, random):
    save(folder, name, decoded(data)[: random.integers(1, 240), : random.integers(1, 320)])


def sideways(folder, name, data, random):
    """As a phone held upright stores it: rotated pixels, and a tag that says so."""
    picture = Image.fromarray(np.rot90(decoded(data)[..., ::-1]))
    exif = picture.getexif()
    exif[274] = 6
    picture.save(folder / name, exif=exif)


def grey16(folder, name, data, random):
    save(folder, Path(name).with_suffix(".png").name, 200 * decoded(data)[..., 0].astype(np.uint16))


def transparent(folder, name, data, random):
    Image.fromarray(decoded(data)[..., ::-1]).convert("RGBA").save(folder / Path(name).with_suffix(".png").name)


def wrong_lens(folder, name, data, random):
    picture = Image.fromarray(decoded(data)[..., ::-1])
    exif = picture.getexif()
    exif.get_ifd(34665)[41989] = int(random.integers(10, 500))
    picture.save(folder / name, exif=exif)


def odd_kind(folder, name, data, random):
    mode, suffix = [("P", ".png"), ("CMYK", ".jpg"), ("1", ".tif"), ("L", ".png"), ("LA", ".png"), ("YCbCr", ".jpg")][
        random.integers(6)
    ]
    Image.fromarray(decoded(data)[..., ::-1]).convert(mode).save((folder / name).with_suffix(suffix))


def gone(folder, name, data, random):
    pass


def duplicate(folder, name, data, random):
    (folder / name).write_bytes(data)
    (folder / f"again_{name}").write_bytes(data)


FAULTS = (black, noise, unrelated, truncated, damaged, smaller, cropped, sideways, grey16, transparent, wrong_lens)
FAULTS += (odd_kind, gone, duplicate)


def broken_set(folder: Path, good: list[bytes], seed: int) -> None:
    """One or two kinds of faults in some, most or all of the photos; a board or none."""
    random = np.random.default_rng(seed)
    kinds = random.choice(len(FAULTS), size=random.integers(1, 3), replace=False)
    share = random.choice([0.15, 0.5, 0.9, 1.0])
    for k, data in enumerate(good):
        if random.uniform() < share:
            FAULTS[random.choice(kinds)](folder, f"{k:03d}.jpg", data, random)
        else:
            (folder / f"{k:03d}.jpg").write_bytes(data)
    if random.uniform() < 0.5:
        (folder / "board.yaml").write_text(str(random.choice(BOARDS)))


def outcome(folder: Path) -> VtoError | None:
    """Reconstruct a set; what is not a VtoError goes through, and that is what these tests are for."""
    try:
        assert reconstruct(folder, Job()) > 0
    except VtoError as error:
        return error
    return None


@pytest.mark.parametrize(
    "fault",
    [
        black,
        unrelated,
        truncated,
        smaller,
        *(pytest.param(one, marks=pytest.mark.slow) for one in (sideways, duplicate)),
    ],
    ids=lambda f: f.__name__,
)
def test_every_other_photo_broken_ends_with_a_surface_or_a_reason(good, tmp_path, fault):
    random = np.random.default_rng(0)
    for k, data in enumerate(good):
        (tmp_path / f"{k:03d}.jpg").write_bytes(data)
        if k % 2:
            fault(tmp_path, f"{k:03d}.jpg", data, random)
    error = outcome(tmp_path)
    if fault is duplicate:
        assert error is None
    elif fault is truncated:
        assert error.exit_code == 3
        assert error.where.endswith("001.jpg")
    else:  # the whole ones are 28 degrees apart, which may or may not do
        assert error is None or error.exit_code == 4


def test_one_photo_is_refused(good, tmp_path):
    (tmp_path / "alone.jpg").write_bytes(good[0])
    assert outcome(tmp_path).exit_code == 3


@pytest.mark.slow
def test_many_broken_sets_end_with_a_surface_or_a_reason(good, tmp_path):
    ends = []
    for seed in range(300):
        (tmp_path / str(seed)).mkdir()
        broken_set(tmp_path / str(seed), good, seed)
        ends.append(outcome(tmp_path / str(seed)))
    assert {0 if end is None else end.exit_code for end in ends} == {0, 3, 4}
    assert 0.2 < np.mean([end is None for end in ends]) < 0.9


def fail(*args, **kwargs):
    raise RuntimeError("[scene.cc:12] Check failed: out of\nluck")


def test_a_mapper_that_fails_is_noted_and_the_other_one_is_used(good, tmp_path, monkeypatch):
    for k, data in enumerate(good):
        (tmp_path / f"{k}.jpg").write_bytes(data)
    monkeypatch.setattr(pycolmap, "global_mapping", fail)
    job = Job()
    cameras, _ = estimate_cameras(read_photos(tmp_path), SfmConfig(), job)
    assert len(cameras.names) == COUNT
    assert "the global mapper failed: Check failed: out of luck" in job.notes
    monkeypatch.setattr(pycolmap, "incremental_mapping", fail)
    with pytest.raises(ScanError, match=f"fewer than 3 of {COUNT}"):
        estimate_cameras(read_photos(tmp_path), SfmConfig(), Job())


@pytest.mark.parametrize("step", ["import_images", "extract_features", "match_image_pairs"])
def test_what_colmap_cannot_do_is_a_reason(good, tmp_path, monkeypatch, step):
    for k in range(2):
        (tmp_path / f"{k}.jpg").write_bytes(good[k])
    monkeypatch.setattr(pycolmap, step, fail)
    with pytest.raises(ScanError, match=r"(photos|0.jpg).*: Check failed: out of luck"):
        estimate_cameras(read_photos(tmp_path), SfmConfig(), Job())


def test_a_photo_that_the_board_detector_fails_on_is_noted(shot, monkeypatch):
    class Failing:
        def __init__(self, board, reading):
            pass

        def detectBoard(self, gray):  # OpenCV's name
            raise cv2.error("OpenCV(5.0) aruco.cpp:7: error: (-215) size")

    monkeypatch.setattr(cv2.aruco, "CharucoDetector", Failing)
    job = Job()
    found = detect_board(shot[0], ("000.jpg", "003.jpg"), job)
    assert [len(ids) for ids, _ in found] == [0, 0]
    assert [note.split(":")[0] for note in job.notes] == ["no board in 000.jpg", "no board in 003.jpg"]


def test_depth_maps_of_a_few_pixels_are_refused(shot, true_cameras):
    """Open3D has no voxel to extract a surface from, and raises an error of its own."""
    depth = np.zeros((16, 360, 480), np.float32)
    depth[:, 101, 101] = 0.9
    maps = DepthMaps(true_cameras.names, true_cameras.intrinsics, shot[1], depth)
    with pytest.raises(ScanError, match="2 of 16"):
        fuse_depth_maps(shot[0], true_cameras, maps, FuseConfig(), Job())


def test_messages_of_libraries_lose_their_decoration():
    text = "\x1b[1;31m[Open3D Error] (void open3d::f(const Tensor&) const) /root/a.cpp:361: keys should > 0.\n\x1b[0;m"
    assert library_message(RuntimeError(text)) == "keys should > 0."
    assert library_message(ValueError("[mvs.cc:51] Dense stereo")) == "Dense stereo"
    assert library_message(IndexError()) == "IndexError"


def test_what_opencv_says_is_of_that_error_and_not_of_the_last_one():
    said = []
    for call in (lambda: cv2.resize(np.zeros((0, 0), np.uint8), (3, 3)), lambda: cv2.cvtColor(1, cv2.COLOR_BGR2RGB)):
        with pytest.raises(cv2.error) as caught:
            call()
        said.append(caught.value)
    assert library_message(said[0]) == "!ssize.empty()"
    assert library_message(said[1]).startswith("Unsupported depth of input image: 'VDepth::contains(depth)'")
    assert library_message(cv2.error("Insufficient memory")) == "Insufficient memory"
