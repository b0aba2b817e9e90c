"""STL: triangles with separate corners, binary or ASCII. Corners are not merged here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF
from vto_pipeline.io.text_numbers import parse_rows, read_lines

_HEADER_BYTES, _FACE_BYTES = 84, 50
_FACE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def parse_stl(name: str) -> Arrays:
    """Read an STL file.

    Args:
        name: Path of the file.

    Returns:
        vertices (3F, 3), three for each face; faces (F, 3).

    Raises:
        FormatError: the file breaks the format, or its count does not fit its size.
    """
    path = Path(name)
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(_HEADER_BYTES)
    claimed = int.from_bytes(head[80:84], "little")
    if size == _HEADER_BYTES + _FACE_BYTES * claimed and len(head) == _HEADER_BYTES:
        corners = np.fromfile(path, _FACE, claimed, offset=_HEADER_BYTES)["corners"].reshape(-1, 3).astype(np.float64)
    elif head.lstrip().startswith(b"solid"):
        corners = _parse_text(path)
    else:
        problem = f"{size} bytes; {claimed} faces, as the header says, take {_HEADER_BYTES + _FACE_BYTES * claimed}"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    return {"vertices": corners, "faces": np.arange(len(corners), dtype=np.int64).reshape(-1, 3)}


def _parse_text(path: Path) -> np.ndarray:
    """The corners of an ASCII file, shape (3F, 3)."""
    lines = read_lines(path)
    words = [line.split(None, 1) for line in lines]
    keys = [w[0].lower() if w else "" for w in words]
    at = [i for i, key in enumerate(keys) if key == "vertex"]
    rows = [words[i][1] if len(words[i]) > 1 else "" for i in at]
    if not at or "endsolid" not in keys or len(at) != 3 * keys.count("facet") or len(at) != 3 * keys.count("endfacet"):
        problem = f"{keys.count('facet')} facets, {len(at)} corners, {keys.count('endsolid')} endsolid"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    corners = parse_rows(rows, [i + 1 for i in at], path)
    if corners.shape[1] != 3:
        raise FormatError(f"corners have {corners.shape[1]} coordinates", where=str(path))
    return corners
