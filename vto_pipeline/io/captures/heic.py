"""HEIC pictures, as phones take them: decoded by libheif in a limited child process, and worked with as JPEG."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError, MissingDependencyError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.captures.exif import BROKEN
from vto_pipeline.io.files import check_file
from vto_pipeline.io.sandbox import run_limited

SUFFIXES = frozenset({".heic", ".heif"})

_FILE_BYTES = 500_000_000
_PIXELS = 80_000_000
_JPEG_QUALITY = 95


def copy_as_jpeg(paths: Sequence[Path], folder: Path) -> tuple[Path, ...]:
    """Copy pictures into a folder, those in HEIC as JPEG with their EXIF; others as they are.

    Args:
        paths: Pictures of any kind.
        folder: Where to.

    Returns:
        The copies, in the same order; `a.heic` becomes `a.heic.jpg`.

    Raises:
        MissingDependencyError: no library for HEIC; FormatError: a picture is broken.
    """
    if find_spec("pi_heif") is None:
        raise MissingDependencyError("HEIC pictures need pi-heif", hint="pip install 'vto-pipeline[heic]'")
    copies = []
    for path in paths:
        if path.suffix.lower() in SUFFIXES:
            check_file(path, SUFFIXES, _FILE_BYTES)
            copies.append(folder / f"{path.name}.jpg")
            copies[-1].write_bytes(run_limited(encode_jpeg, str(path.resolve()), where=str(path))["jpeg"].tobytes())
        else:
            copies.append(Path(shutil.copy(path, folder)))
    return tuple(copies)


def encode_jpeg(name: str) -> Arrays:
    """Decode a HEIC picture and encode it as JPEG; runs in the child process.

    libheif turns the pixels upright, so that the EXIF it goes with says they are.
    """
    from pi_heif import register_heif_opener
    from PIL import Image

    register_heif_opener()
    try:
        with Image.open(name, formats=("HEIF",)) as image:
            if image.width * image.height > _PIXELS:
                problem = f"the picture claims {image.width} x {image.height} pixels"
                raise FormatError(f"{problem}; the limit is {_PIXELS // 1_000_000} million", where=name)
            encoded = BytesIO()
            image.convert("RGB").save(encoded, "JPEG", quality=_JPEG_QUALITY, exif=image.getexif())
    except (*BROKEN, Image.DecompressionBombError, RuntimeError) as e:  # the last by libheif
        raise FormatError(f"not a readable HEIC picture: {e}", where=name) from None
    return {"jpeg": np.frombuffer(encoded.getvalue(), dtype=np.uint8)}
