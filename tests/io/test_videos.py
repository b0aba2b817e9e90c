"""Videos of a textured picture that slides by known steps, some frames of it blurred."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.captures.video import extract_frames, measure_frames, read_video

WIDTH, HEIGHT, STEP, FRAMES = 320, 240, 6, 24


def write_video(path: Path, codec: str = "mp4v", still: int = 0) -> None:
    """A window that slides over a picture by STEP pixels a frame, every third one blurred; then it stands still."""
    import cv2

    rng = np.random.default_rng(5)
    wide = cv2.GaussianBlur(rng.uniform(0, 255, (HEIGHT, WIDTH + STEP * FRAMES)), (0, 0), 2.0)
    wide = np.repeat(np.clip(128 + 4 * (wide - wide.mean()), 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), 10, (WIDTH, HEIGHT))
    for frame in [*range(FRAMES), *[FRAMES - 1] * still]:
        picture = np.ascontiguousarray(wide[:, STEP * frame : STEP * frame + WIDTH])
        writer.write(cv2.blur(picture, (9, 9)) if frame % 3 == 2 else picture)
    writer.release()


@pytest.mark.parametrize(("name", "codec"), [("a.mp4", "mp4v"), ("a.avi", "MJPG"), ("a.mkv", "mp4v")])
def test_motion_and_sharpness_are_those_of_the_frames(tmp_path: Path, name: str, codec: str) -> None:
    write_video(tmp_path / name, codec, still=4)
    video = read_video(tmp_path / name)
    assert (video.width, video.height) == (WIDTH, HEIGHT)
    sharpness, motion = measure_frames(video)
    assert len(sharpness) == len(motion) == FRAMES + 4
    # half a pixel of the diagonal: compression moves corners by as much
    assert_allclose(motion[1:FRAMES], STEP / 400.0, rtol=0, atol=0.5 / 400.0)
    assert_allclose(motion[FRAMES:], 0.0, rtol=0, atol=0.5 / 400.0)  # the same
    blurred = np.arange(FRAMES) % 3 == 2
    assert sharpness[:FRAMES][blurred].max() < 0.5 * sharpness[:FRAMES][~blurred].min()


def test_the_frames_asked_for_are_written(tmp_path: Path) -> None:
    import cv2

    write_video(tmp_path / "a.avi", "MJPG")
    capture, frames = cv2.VideoCapture(str(tmp_path / "a.avi")), []
    while (answer := capture.read())[0]:
        frames.append(answer[1])
    paths = extract_frames(read_video(tmp_path / "a.avi"), [1, 17], tmp_path)
    assert [path.name for path in paths] == ["frame_000001.jpg", "frame_000017.jpg"]
    for path, index in zip(paths, (1, 17), strict=True):
        off = read_image(path).astype(float) - frames[index][:, :, ::-1]
        assert np.sqrt((off**2).mean()) < 3.0  # of 255: JPEG at quality 95


def test_a_folder_may_hold_a_video_and_its_board(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mp4")
    assert read_video(tmp_path).board is None
    (tmp_path / "board.yaml").write_text("{columns: 7, rows: 5, square_mm: 30, marker_mm: 22}")
    board = read_video(tmp_path).board
    assert board is not None
    assert board.square_m == pytest.approx(0.03)
    write_video(tmp_path / "b.mp4")
    with pytest.raises(InputError, match="2 videos; expected one"):
        read_video(tmp_path)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_what_cannot_be_decoded_is_refused(tmp_path: Path, share: float) -> None:
    write_video(tmp_path / "a.mp4")
    whole = (tmp_path / "a.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(whole[: int(share * len(whole))] or bytes(5000))
    with pytest.raises(FormatError, match="cannot decode"):
        read_video(tmp_path / "a.mp4")
