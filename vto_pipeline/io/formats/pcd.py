"""PCD 0.7 (Point Cloud Library): ASCII, binary and compressed, read by Open3D once its header is known to be true."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF
from vto_pipeline.io.text_numbers import parse_rows

_HEADER_BYTES = 100_000
_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}


def parse_pcd(name: str) -> Arrays:
    """Read a PCD file; points without a reading (NaN) are dropped, as the format intends.

    Args:
        name: Path of the file.

    Returns:
        vertices (N, 3); normals (N, 3) and colors (N, 3) uint8, where given; notes.

    Raises:
        FormatError: the file breaks the format, or its count does not fit its size.
    """
    path = Path(name)
    data = path.read_bytes()
    at = data.find(b"\nDATA ", 0, _HEADER_BYTES)
    stop = data.find(b"\n", at + 1)
    if at < 0 or stop < 0:
        raise FormatError("not a PCD file: no DATA line", where=str(path), hint=CUT_OFF)
    lines = data[:stop].decode("latin-1").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines) if words and not words[0].startswith("#")}
    count = _check(header, data[stop + 1 :], len(lines), path)
    import open3d as o3d

    cloud = o3d.t.io.read_point_cloud(path, format="pcd")
    found = {
        name: np.array(cloud.point[name].numpy()) for name in ("positions", "normals", "colors") if name in cloud.point
    }
    if len(found.get("positions", ())) != count:
        raise FormatError("Open3D cannot read the points", where=str(path), hint=CUT_OFF)
    arrays: Arrays = {"vertices": found.pop("positions").astype(np.float64), **found}
    kept = ~np.isnan(arrays["vertices"]).any(axis=1)
    notes = [f"dropped {np.sum(~kept)} points without a reading (NaN)"] if not kept.all() else []
    return {**{name: values[kept] for name, values in arrays.items()}, "notes": np.array(notes, dtype=np.str_)}


def _check(header: dict[str, list[str]], body: bytes, header_lines: int, path: Path) -> int:
    """Number of points, all of which are there."""
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not header.get(key)]
    if missing:
        raise FormatError(f"the header lacks {', '.join(missing)}", where=str(path))
    names, kinds = header["FIELDS"], header["TYPE"]
    repeats = header.get("COUNT", ["1"] * len(names))
    if not len(names) == len(header["SIZE"]) == len(kinds) == len(repeats):
        raise FormatError("FIELDS, SIZE, TYPE and COUNT differ in length", where=str(path))
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(f"points have no x, y, z; found {', '.join(names)}", where=str(path))
    try:
        sizes, widths, count = list(map(int, header["SIZE"])), list(map(int, repeats)), int(header["POINTS"][0])
    except ValueError as e:
        raise FormatError(f"cannot parse the header: {e}", where=str(path)) from None
    for field, size, kind, width in zip(names, sizes, kinds, widths, strict=True):
        if size not in _SIZES.get(kind, ()) or width < 1:
            raise FormatError(f"cannot parse the header: {field} is {width} of {kind}{size}", where=str(path))
    if count < 1:
        raise FormatError(f"{count} points", where=str(path))
    promised = count * int(np.dot(sizes, widths))
    match header["DATA"]:
        case ["ascii"]:
            _check_text(body, count, sum(widths), header_lines, path)
        case ["binary"]:
            if len(body) < promised:
                problem = f"{count} points promised ({promised} bytes), {len(body)} bytes follow"
                raise FormatError(problem, where=str(path), hint=CUT_OFF)
        case ["binary_compressed"]:
            packed, unpacked = (int.from_bytes(body[i : i + 4], "little") for i in (0, 4))
            if len(body) < 8 + packed or unpacked != promised:
                problem = f"{promised} bytes promised, {unpacked} packed into {packed}, {len(body)} bytes follow"
                raise FormatError(problem, where=str(path), hint=CUT_OFF)
        case other:
            problem = f"DATA {' '.join(other)} is not supported; expected ascii, binary or binary_compressed"
            raise FormatError(problem, where=str(path))
    return count


def _check_text(body: bytes, count: int, width: int, header_lines: int, path: Path) -> None:
    """Refuse points that are no lines of `width` numbers: Open3D takes a token that is none for a zero."""
    lines = [(line, i) for i, line in enumerate(body.decode("latin-1").splitlines(), header_lines + 1) if line.strip()]
    if len(lines) != count:
        raise FormatError(f"{count} points promised, {len(lines)} lines follow", where=str(path), hint=CUT_OFF)
    rows = parse_rows([line for line, _ in lines], [i for _, i in lines], path)
    if rows.shape[1] != width:
        raise FormatError(f"{rows.shape[1]} numbers in a line, {width} in the header", where=str(path))
