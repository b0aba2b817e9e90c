"""Frames of a video are chosen by motion and sharpness."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from vto_pipeline.errors import FormatError, ScanError
from vto_pipeline.io.captures.photo_archive import read_photo_archive, write_photo_archive
from vto_pipeline.model.frames import CharucoBoard, PhotoSet, Video
from vto_pipeline.model.job import Job
from vto_pipeline.scan.keyframes import KeyframesConfig, choose_keyframes, take_keyframes


def test_equal_motion_takes_the_sharp_frames() -> None:
    motion = np.full(120, 0.01)
    sharpness = np.where(np.arange(120) % 4 == 1, 10.0, 1.0)
    chosen = choose_keyframes(sharpness, motion, KeyframesConfig(step=0.04))
    assert (sharpness[chosen] == 10.0).all()
    assert len(chosen) in (29, 30)  # 1.2 diagonals in steps of 0.04, but for rounding


def test_a_camera_that_rests_gives_one_frame() -> None:
    motion = np.concatenate([np.full(50, 0.02), np.zeros(500), np.full(50, 0.02)])
    chosen = choose_keyframes(np.ones(600), motion, KeyframesConfig(step=0.04))
    assert len(chosen) == 50
    assert ((chosen >= 50) & (chosen < 550)).sum() <= 1


def test_a_long_way_gives_no_more_than_asked_for_evenly_spread() -> None:
    motion = np.full(3000, 0.05)
    chosen = choose_keyframes(np.ones(3000), motion, KeyframesConfig(most=60))
    assert len(chosen) == 60
    assert np.ptp(np.diff(chosen)) <= 2  # a frame on the border of two stretches falls into either


def test_a_camera_that_never_moves_is_refused(tmp_path: Path) -> None:
    import cv2

    writer = cv2.VideoWriter(str(tmp_path / "a.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (320, 240))
    picture = np.random.default_rng(0).integers(0, 255, (240, 320, 3)).astype(np.uint8)
    for _ in range(20):
        writer.write(picture)
    writer.release()
    with pytest.raises(ScanError, match="too little for 3 photos"):
        take_keyframes(Video(tmp_path / "a.avi", 320, 240), KeyframesConfig(), Job(scratch=tmp_path))


def test_frames_come_back_from_their_archive(tmp_path: Path) -> None:
    import cv2

    rng = np.random.default_rng(1)
    paths = tuple(tmp_path / f"frame_{k}.jpg" for k in range(3))
    for path in paths:
        cv2.imwrite(str(path), rng.integers(0, 255, (24, 32, 3)).astype(np.uint8))
    board = CharucoBoard(7, 5, 0.03, 0.022)
    photos = PhotoSet(paths, (None,) * 3, board)
    write_photo_archive(tmp_path / "a.zip", photos)
    write_photo_archive(tmp_path / "b.zip", photos)
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    back = read_photo_archive(tmp_path / "a.zip")
    assert back.board == board
    assert [path.read_bytes() for path in back.paths] == [path.read_bytes() for path in paths]


def write_zip(path: Path, name: str, data: bytes, kind: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", kind) as archive:
        archive.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("name", "data", "kind", "says"),
    [
        ("../a.png", b"x", zipfile.ZIP_STORED, "'../a.png' is not a picture"),
        ("a.py", b"x", zipfile.ZIP_STORED, "'a.py' is not a picture"),
        ("x" * 300 + ".png", b"x", zipfile.ZIP_STORED, "is not a name for a file"),
        ("a.png", bytes(1_000_000), zipfile.ZIP_DEFLATED, "'a.png' is not stored as it is"),
        ("board.json", b"[1]", zipfile.ZIP_STORED, "board.json: no board"),
        ("board.json", b"\xff", zipfile.ZIP_STORED, "board.json: no board"),
    ],
)
def test_an_archive_of_other_things_is_refused(tmp_path: Path, name: str, data: bytes, kind: int, says: str) -> None:
    with pytest.raises(FormatError, match=re.escape(says)):
        read_photo_archive(write_zip(tmp_path / "a.zip", name, data, kind))
