"""Photos that a stage has made, in one file: a zip of pictures, unpacked for as long as the process lives."""

from __future__ import annotations

import json
import zipfile
from dataclasses import asdict
from functools import cache
from pathlib import Path

from vto_pipeline.errors import FormatError
from vto_pipeline.io.captures.images import SUFFIXES
from vto_pipeline.io.files import check_file, listed, process_folder, replacing
from vto_pipeline.model.frames import CharucoBoard, PhotoSet

_EPOCH = (1980, 1, 1, 0, 0, 0)  # a real date would change the bytes
_BOARD = "board.json"
_FILE_BYTES = 20_000_000_000


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
    try:
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                (folder / Path(name).name).write_bytes(archive.read(name))
        there = (folder / _BOARD).exists()
        board = CharucoBoard(**json.loads((folder / _BOARD).read_text())) if there else None
    except (zipfile.BadZipFile, ValueError, TypeError) as e:
        raise FormatError(f"not an archive of photos: {e}", where=str(path)) from None
    pictures = listed(folder, SUFFIXES)
    return PhotoSet(pictures, (None,) * len(pictures), board)
