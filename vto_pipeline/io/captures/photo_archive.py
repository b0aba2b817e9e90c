"""Photos that a stage has made, in one file: a zip of pictures, unpacked for as long as the process lives."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import BROKEN_ZIP
from vto_pipeline.io.captures.images import SUFFIXES
from vto_pipeline.io.files import check_file, listed, process_folder, replacing
from vto_pipeline.model.frames import CharucoBoard, PhotoSet

_EPOCH = (1980, 1, 1, 0, 0, 0)  # a real date would change the bytes
_BOARD = "board.json"
_FILE_BYTES = 20_000_000_000
_NAME_BYTES = 255  # what file systems hold


def write_photo_archive(path: Path, photos: PhotoSet) -> None:
    """Write photos whose lens is not known."""
    with replacing(path) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_STORED) as archive:
        for picture in photos.paths:
            archive.writestr(zipfile.ZipInfo(picture.name, _EPOCH), picture.read_bytes())
        if photos.board is not None:
            archive.writestr(zipfile.ZipInfo(_BOARD, _EPOCH), json.dumps(asdict(photos.board)))


@cache
def read_photo_archive(path: Path) -> PhotoSet:
    """Unpack what `write_photo_archive` wrote into a temporary folder.

    Raises:
        InputError: no such file; FormatError: damaged since.
    """
    path = check_file(Path(path), {".zip"}, _FILE_BYTES)
    folder = process_folder()
    board = None
    for name, data in _members(path):
        if name == _BOARD:
            board = _board(data, path)
        else:
            (folder / name).write_bytes(data)
    pictures = listed(folder, SUFFIXES)
    return PhotoSet(pictures, (None,) * len(pictures), board)


def _members(path: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and bytes of what is stored, in its order; nothing is inflated."""
    try:
        with zipfile.ZipFile(path) as archive:
            for entry in archive.infolist():
                name = entry.filename
                if name != _BOARD and (Path(name).suffix.lower() not in SUFFIXES or Path(name).name != name):
                    raise ValueError(f"{name!r} is not a picture")
                if entry.compress_type != zipfile.ZIP_STORED or entry.file_size > path.stat().st_size:
                    raise ValueError(f"{name!r} is not stored as it is")
                if not name.isprintable() or len(name.encode()) > _NAME_BYTES:
                    raise ValueError(f"{name!r} is not a name for a file")
                yield name, archive.read(entry)
    except BROKEN_ZIP as e:
        raise FormatError(f"not an archive of photos: {e}", where=str(path)) from None


def _board(data: bytes, path: Path) -> CharucoBoard:
    try:
        return CharucoBoard(**json.loads(data))
    except (RecursionError, TypeError, ValueError) as e:
        raise FormatError(f"{_BOARD}: no board: {e}", where=str(path)) from None
