"""Videos: decoded by OpenCV in a limited child process, which also measures how frames move and how sharp they are."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.captures.photos import BOARD_FILE, read_board
from vto_pipeline.io.files import check_file, listed
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.frames import Video
from vto_pipeline.model.job import Job

SUFFIXES = frozenset({".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm"})

_FILE_BYTES = 8_000_000_000
_PIXELS = 40_000_000
_SECONDS = 1800.0  # a long video at the pace of a slow machine
_SHORT_SIDE = 240  # px: enough to see how the picture moves, however large it is
_CORNERS, _CORNER_QUALITY, _CORNER_APART = 200, 0.01, 7
_MOVING = 0.8  # quantile of the corners' motion: on a turntable most of the picture may stand still
_JPEG_QUALITY = 95


def read_video(path: Path, *, job: Job | None = None) -> Video:
    """Open a video, or the only one of a folder, which may hold a board.yaml beside it.

    Args:
        path: A file, or a folder.
        job: Receives what was found.

    Returns:
        Where it is, and its size.

    Raises:
        InputError: there is none, or several; FormatError: OpenCV cannot decode it.
    """
    folder = Path(path) if Path(path).is_dir() else None
    path = Path(path)
    if folder is not None:
        inside = listed(folder, SUFFIXES)
        if len(inside) != 1:
            raise InputError(f"{len(inside)} videos; expected one", where=str(path))
        path = inside[0]
    path = check_file(path, SUFFIXES, _FILE_BYTES)
    found = run_limited(probe, str(path.resolve()), where=str(path))
    board = None if folder is None or not (folder / BOARD_FILE).exists() else read_board(folder / BOARD_FILE)
    video = Video(path.resolve(), int(found["width"]), int(found["height"]), board)
    if job is not None:
        job.note(f"{path.name}: a video of {video.width} x {video.height}")
    return video


def measure_frames(video: Video) -> tuple[FloatArray, FloatArray]:
    """Decode all frames, and measure each.

    Returns:
        Sharpness (N,), the variance of the Laplacian of the picture's brightness; and motion since the frame before, as
        a share of the diagonal, shape (N,).

    Raises:
        FormatError: it cannot be decoded.
    """
    found = run_limited(measure_all, str(video.path), where=str(video.path), seconds=_SECONDS)
    return found["sharpness"], found["motion"]


def extract_frames(video: Video, indices: Sequence[int], folder: Path) -> tuple[Path, ...]:
    """Write some of the frames as JPEG files, and return their paths.

    Args:
        video: The video.
        indices: Which frames, ascending.
        folder: Where to.

    Raises:
        FormatError: it cannot be decoded.
    """
    order = json.dumps([int(index) for index in indices])
    found = run_limited(encode_some, str(video.path), order, where=str(video.path), seconds=_SECONDS)
    paths = tuple(folder / f"frame_{index:06d}.jpg" for index in indices)
    ends = np.cumsum(found["sizes"])
    for path, begin, end in zip(paths, [0, *ends[:-1]], ends, strict=True):
        path.write_bytes(found["bytes"][begin:end].tobytes())
    return paths


def probe(name: str) -> Arrays:
    """Decode the first frame; runs in the child process. Returns width and height [px]."""
    frame = next(_frames(name), None)
    if frame is None:
        raise FormatError("OpenCV cannot decode a single frame", where=name, hint="save it as MP4 with H.264")
    height, width = frame.shape[:2]
    return {"width": np.array(width), "height": np.array(height)}


def measure_all(name: str) -> Arrays:
    """Measure every frame; runs in the child process. Returns sharpness (N,) and motion (N,)."""
    import cv2

    sharpness, motion, before = [], [], None
    for frame in _frames(name):
        scale = min(1.0, _SHORT_SIDE / min(frame.shape[:2]))
        gray = cv2.cvtColor(
            cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY
        )
        sharpness.append(float(cv2.Laplacian(gray, cv2.CV_64F).var()))
        motion.append(0.0 if before is None else _motion(before, gray))
        before = gray
    return {"sharpness": np.array(sharpness), "motion": np.array(motion)}


def encode_some(name: str, order: str) -> Arrays:
    """Encode the frames of a JSON list of numbers as JPEG; runs in the child process. Returns bytes and sizes (N,)."""
    import cv2

    wanted, files = set(json.loads(order)), []
    for index, frame in enumerate(_frames(name)):
        if index in wanted:
            _, file = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            files.append(file.ravel())
    if len(files) != len(wanted):
        raise FormatError(f"{len(wanted)} frames wanted, {len(files)} decoded", where=name)
    return {"bytes": np.concatenate(files), "sizes": np.array([len(file) for file in files])}


def _frames(name: str) -> Iterator[ByteArray]:
    """Frames in order, upright, shape (H, W, 3) as OpenCV has them."""
    import cv2

    capture = cv2.VideoCapture(name, cv2.CAP_FFMPEG)
    try:
        while True:
            there, frame = capture.read()
            if not there:
                return
            if frame.shape[0] * frame.shape[1] > _PIXELS:
                problem = (
                    f"frames of {frame.shape[1]} x {frame.shape[0]} pixels; the limit is {_PIXELS // 1_000_000} million"
                )
                raise FormatError(problem, where=name)
            yield np.asarray(frame, dtype=np.uint8)
    finally:
        capture.release()


def _motion(before: Any, after: Any) -> float:
    """How far corners moved between two pictures (Lucas & Kanade 1981), as a share of the diagonal; 0 where none is."""
    import cv2

    corners = cv2.goodFeaturesToTrack(before, _CORNERS, _CORNER_QUALITY, _CORNER_APART)
    if corners is None:
        return 0.0
    there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, np.empty_like(corners))
    moved: FloatArray = np.linalg.norm(there - corners, axis=-1).ravel()
    kept: IntArray = found.ravel() > 0
    return float(np.quantile(moved[kept], _MOVING) / np.hypot(*before.shape)) if kept.any() else 0.0
