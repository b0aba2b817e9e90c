"""The camera data in a picture's EXIF. Tags are hints: an unreadable tag counts as absent."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from PIL import Image

BROKEN = (OSError, SyntaxError, ValueError, TypeError, struct.error, EOFError, IndexError, KeyError, OverflowError)
"""What Pillow raises on damaged bytes."""

_ORIENTATION, _EXIF = 274, 34665
_FOCAL_LENGTH, _FOCAL_35MM, _PIXEL_WIDTH, _PLANE_RESOLUTION, _PLANE_UNIT = 37386, 41989, 40962, 41486, 41488
_UNIT_MM = {2.0: 25.4, 3.0: 10.0, 4.0: 1.0, 5.0: 0.001}  # EXIF 2.32, tag FocalPlaneResolutionUnit
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
_PLAUSIBLE = (0.3, 20.0)  # focal length in picture widths


def read_exif(image: Image.Image) -> tuple[int, float]:
    """Orientation and focal length of an opened picture.

    Returns:
        Orientation as EXIF numbers it, 1 for upright; focal length [px], NaN where it is not known.
    """
    try:
        tags = image.getexif()
        orientation, details = int(tags.get(_ORIENTATION, 1)), tags.get_ifd(_EXIF)
    except BROKEN:
        return 1, math.nan
    return orientation, focal_length_px(details, image.width, image.height)


def focal_length_px(exif: Mapping[int, Any], width: int, height: int) -> float:
    """Focal length of a photo from its EXIF tags.

    The sensor's resolution comes first: FocalLength x FocalPlaneXResolution, for the width the camera wrote, which a
    later resize changes. Else FocalLengthIn35mmFilm, a whole number and so coarser, which compares diagonals (CIPA
    DC-008).

    Args:
        exif: Tag number -> value, of the EXIF directory.
        width, height: Of the stored picture [px].

    Returns:
        Focal length [px], or NaN.
    """
    focal_mm, resolution = _number(exif, _FOCAL_LENGTH), _number(exif, _PLANE_RESOLUTION)
    unit_mm = _UNIT_MM.get(_number(exif, _PLANE_UNIT, 2), math.nan)
    written = _number(exif, _PIXEL_WIDTH, width)
    by_sensor = focal_mm * resolution / unit_mm * max(width, height) / written if written > 0 else math.nan
    by_film = _number(exif, _FOCAL_35MM) * math.hypot(width, height) / _FILM_DIAGONAL_MM
    for focal in (by_sensor, by_film):
        if _PLAUSIBLE[0] < focal / max(width, height) < _PLAUSIBLE[1]:
            return focal
    return math.nan


def _number(exif: Mapping[int, Any], tag: int, default: float = math.nan) -> float:
    """Return a tag as a number, or the default if it is absent or invalid, such as 0/0."""
    try:
        return float(exif.get(tag, default))
    except (TypeError, ValueError, ZeroDivisionError):
        return default
