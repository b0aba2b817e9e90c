"""Pictures as PNG, JPEG or TIFF; the size in the header is checked before any pixel is decoded.

Pixels are given as they are stored, not turned as EXIF says: the scan's geometry is that of the stored picture, and
pycolmap reads it so, too.

A folder is decoded once, whole, in one limited child process, before its pictures are read again one by one in the
process that works with them. One child per picture would cost a quarter of a second each; one for all shows that these
bytes pass through this decoder within the limits, and finds a picture that is cut off before an hour of work is spent.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.captures.exif import BROKEN, read_exif
from vto_pipeline.io.files import check_file
from vto_pipeline.io.sandbox import run_limited
from vto_pipeline.model.arrays import ByteArray

if TYPE_CHECKING:
    from PIL import Image

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff"})

_PIXELS = 80_000_000
_FILE_BYTES = 500_000_000
_SECONDS_EACH = 5.0
_ORIENTATION = 274  # EXIF tag


def read_image(path: Path) -> ByteArray:
    """Decode a picture.

    Args:
        path: PNG, JPEG or TIFF.

    Returns:
        sRGB as stored, shape (H, W, 3), uint8.

    Raises:
        InputError: no such file; FormatError: too many pixels, or broken.
    """
    with open_image(check_file(Path(path), SUFFIXES, _FILE_BYTES)) as image:
        _whole(image.load, path)
        return np.array(image.convert("RGB"))


def read_gray16(path: Path) -> NDArray[np.uint16]:
    """Decode a picture with one 16-bit channel, such as a depth frame.

    Returns:
        Shape (H, W).

    Raises:
        InputError: no such file; FormatError: other depth or channels, too many pixels, or broken.
    """
    with open_image(check_file(Path(path), SUFFIXES, _FILE_BYTES)) as image:
        _whole(image.load, path)
        if not image.mode.startswith("I;16"):
            problem = f"the picture has pixel mode {image.mode}; expected one 16-bit channel"
            hint = "saving depth as a colour or 8-bit picture loses its values"
            raise FormatError(problem, where=str(path), hint=hint)
        return np.array(image).astype(np.uint16)


def read_image_size(path: Path) -> tuple[int, int]:
    """Width and height [px] from the header; no pixel is decoded.

    Raises:
        InputError: no such file; FormatError: no picture, or too many pixels.
    """
    with open_image(check_file(Path(path), SUFFIXES, _FILE_BYTES)) as image:
        return image.width, image.height


def check_images(paths: Sequence[Path]) -> Arrays:
    """Check that pictures decode, in one limited child process.

    Args:
        paths: The pictures.

    Returns:
        What `decode_all` returns.

    Raises:
        InputError: a picture is missing, too large or broken.
    """
    for path in paths:
        check_file(path, SUFFIXES, _FILE_BYTES)
    names = "\n".join(str(path.resolve()) for path in paths)
    seconds = 30.0 + _SECONDS_EACH * len(paths)
    return run_limited(decode_all, names, where=str(paths[0].parent), seconds=seconds)


def decode_all(names: str) -> Arrays:
    """Decode every picture; runs in the child process.

    Args:
        names: Paths, joined by newlines.

    Returns:
        sizes (N, 2), width and height [px]; modes (N,), as Pillow calls them; orientations (N,), as EXIF numbers them;
        focal_px (N,) from EXIF [px], NaN where it does not tell.
    """
    sizes, modes, exif = [], [], []
    for name in names.split("\n"):
        with open_image(Path(name)) as image:
            _whole(image.verify, Path(name))  # decoding does not look at checksums
        with open_image(Path(name)) as image:
            exif.append(read_exif(image))  # first: Pillow closes a TIFF once it is loaded
            _whole(image.load, Path(name))
            sizes.append(image.size)
            modes.append(image.mode)
    return {
        "sizes": np.array(sizes, dtype=np.int64),
        "modes": np.array(modes, dtype=np.str_),
        "orientations": np.array([orientation for orientation, _ in exif], dtype=np.int64),
        "focal_px": np.array([focal for _, focal in exif], dtype=np.float64),
    }


def open_image(path: Path) -> Image.Image:
    """Open a picture without decoding it.

    Raises:
        FormatError: no picture of an allowed kind, or too many pixels.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            image = Image.open(path, formats=("PNG", "JPEG", "TIFF"))
    except Image.DecompressionBombError:
        raise _too_many("more than 178 million", path) from None
    except BROKEN as e:
        raise FormatError(f"not a readable picture: {e}", where=str(path)) from None
    if image.width * image.height > _PIXELS:
        image.close()
        raise _too_many(f"{image.width} x {image.height}", path)
    if image.format == "TIFF" and image.getexif().get(_ORIENTATION, 1) != 1:  # which Pillow turns, and others do not
        image.close()
        raise FormatError("a TIFF that EXIF marks as rotated", where=str(path), hint="save it upright")
    return image


def _whole(step: Callable[[], Any], path: Path) -> None:
    """Take a step in which Pillow finds whether a picture is whole: compare a PNG's checksums, or decode."""
    try:
        step()
    except BROKEN as e:
        raise FormatError(f"the picture is damaged or truncated: {e}", where=str(path)) from None


def _too_many(size: str, path: Path) -> InputError:
    problem = f"the picture claims {size} pixels; the limit is {_PIXELS // 1_000_000} million"
    return FormatError(problem, where=str(path), hint="scale it down")
