"""A folder of photos, with the EXIF data of the lens and the board in the scene."""

from __future__ import annotations

import math
from pathlib import Path

from pydantic import Field

from vto_pipeline.errors import ConfigError, InputError
from vto_pipeline.io.captures import heic
from vto_pipeline.io.captures.images import SUFFIXES, check_images
from vto_pipeline.io.documents import check_schema, load_yaml
from vto_pipeline.io.files import check_folder, listed, process_folder
from vto_pipeline.model.camera import Intrinsics
from vto_pipeline.model.frames import CharucoBoard, PhotoSet
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

PHOTO_SUFFIXES = SUFFIXES | heic.SUFFIXES
"""What photos may be; COLMAP and OpenCV read those in HEIC as JPEG."""

BOARD_FILE = "board.yaml"
"""The file that describes the board in a scene."""


class BoardFile(Config):
    """board.yaml: the ChArUco board in the scene."""

    columns: int = Field(gt=1, description="Squares along x")
    rows: int = Field(gt=1, description="Squares along y")
    square_mm: float = Field(gt=0, description="Side of a chess square [mm]")
    marker_mm: float = Field(gt=0, description="Side of a marker [mm]")
    dictionary: str = Field("DICT_4X4_250", pattern="^DICT_[A-Z0-9_]+$", description="OpenCV's name of the marker set")


def read_photos(folder: Path, *, job: Job | None = None) -> PhotoSet:
    """Find the photos of a folder, decode each once in a child process, and read EXIF and board.yaml.

    Args:
        folder: Holds PNG, JPEG, TIFF or HEIC files, and maybe board.yaml.
        job: Receives how many have a known focal length.

    Returns:
        The photos, sorted by name.

    Raises:
        InputError: no folder, fewer than two photos, or a broken one; ConfigError: board.yaml is wrong;
        MissingDependencyError: no library for HEIC.
    """
    folder = check_folder(Path(folder))
    paths = listed(folder, PHOTO_SUFFIXES)
    if len(paths) < 2:
        problem = f"{len(paths)} photo(s) (PNG, JPEG, TIFF, HEIC); at least 2 are needed"
        raise InputError(problem, where=str(folder), hint="is the folder right? raw files are not supported")
    if any(path.suffix.lower() in heic.SUFFIXES for path in paths):
        paths = heic.copy_as_jpeg(paths, process_folder())
    found = check_images(paths)
    intrinsics = tuple(
        _intrinsics(int(width), int(height), float(focal))
        for (width, height), focal in zip(found["sizes"], found["focal_px"], strict=True)
    )
    if job is not None:
        known = sum(camera is not None for camera in intrinsics)
        job.note(f"{folder.name}: {len(paths)} photos, focal length known from EXIF for {known}")
    board = folder / BOARD_FILE
    return PhotoSet(paths, intrinsics, read_board(board) if board.exists() else None)


def read_board(path: Path) -> CharucoBoard:
    """Read board.yaml.

    Raises:
        ConfigError: it breaks the schema of `BoardFile`.
    """
    board = check_schema(load_yaml(path), BoardFile)
    try:
        return CharucoBoard(board.columns, board.rows, board.square_mm / 1000, board.marker_mm / 1000, board.dictionary)
    except InputError as e:
        raise ConfigError(e.problem, where=str(path), hint="the marker must be smaller than the square") from None


def _intrinsics(width: int, height: int, focal: float) -> Intrinsics | None:
    if math.isnan(focal):
        return None
    return Intrinsics(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
