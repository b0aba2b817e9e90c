"""LAS and LAZ (ASPRS LAS 1.0 to 1.4), read by laspy once the header is known to be true."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF
from vto_pipeline.model.arrays import ByteArray

_HEADER_BYTES = 227  # of the oldest version
_VLR_BYTES = 54  # header of a variable length record
_COMPRESSED = 0x80  # LASzip's mark in the point format
_POINTS = 100_000_000


def parse_las(name: str) -> Arrays:
    """Read a LAS or LAZ file.

    Args:
        name: Path of the file.

    Returns:
        vertices (N, 3); colors (N, 3) uint8, where given.

    Raises:
        FormatError: the file breaks the format, or its count does not fit its size.
    """
    import laspy
    import lazrs

    path = Path(name)
    _check_header(path)
    try:
        points = laspy.read(path)
    except (laspy.errors.LaspyException, lazrs.LazrsError, ValueError, struct.error, OSError) as e:
        raise FormatError(f"laspy cannot read the points: {e}", where=str(path), hint=CUT_OFF) from None
    if len(points.points) != points.header.point_count:
        problem = f"{points.header.point_count} points promised, {len(points.points)} are there"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    arrays: Arrays = {"vertices": np.array(points.xyz, dtype=np.float64)}
    if "red" in set(points.point_format.dimension_names):
        arrays["colors"] = _eight_bits(np.stack([points.red, points.green, points.blue], axis=1))
    return arrays


def _check_header(path: Path) -> None:
    """Refuse a header that promises what the file cannot hold."""
    with path.open("rb") as stream:
        head = stream.read(_HEADER_BYTES + 28)
    size = path.stat().st_size
    if head[:4] != b"LASF" or len(head) < _HEADER_BYTES:
        raise FormatError("not a LAS file: no LASF at its begin", where=str(path), hint=CUT_OFF)
    major, minor = head[24:26]
    if major != 1 or minor > 4:
        raise FormatError(f"LAS version {major}.{minor}; expected 1.0 to 1.4", where=str(path))
    header_size, begin, records, kind, length, count = struct.unpack_from("<HIIBHI", head, 94)
    if minor == 4 and len(head) >= 255:
        count = max(count, struct.unpack_from("<Q", head, 247)[0])
    if not header_size <= begin <= size or records * _VLR_BYTES > begin - header_size:
        raise FormatError(f"its points begin at byte {begin} of {size}", where=str(path), hint=CUT_OFF)
    if not 1 <= count <= _POINTS:
        raise FormatError(f"{count} points; 1 to {_POINTS} can be read", where=str(path))
    if not kind & _COMPRESSED and begin + count * length > size:
        problem = f"{count} points promised ({count * length} bytes), {size - begin} bytes follow"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)


def _eight_bits(colors: np.ndarray) -> ByteArray:
    """Colours have 16 bits by the standard; some writers use eight of them."""
    return (colors >> 8 if colors.max(initial=0) > 255 else colors).astype(np.uint8)
