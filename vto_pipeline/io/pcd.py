"""PCD 0.7 (Point Cloud Library): ASCII and binary; compressed files are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.polygons import CUT_OFF
from vto_pipeline.io.text_numbers import parse_rows

_HEADER_BYTES = 100_000
_KINDS = {"F": "f", "I": "i", "U": "u"}


def parse_pcd(name: str) -> Arrays:
    """Read a PCD file; points without a reading (NaN) are dropped, as the format means them to be.

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
    dtype, count = _layout(header, path)
    body = data[stop + 1 :]
    match header["DATA"]:
        case ["binary"]:
            if len(body) < count * dtype.itemsize:
                problem = f"{count} points promised ({count * dtype.itemsize} bytes), {len(body)} bytes follow"
                raise FormatError(problem, where=str(path), hint=CUT_OFF)
            points = np.frombuffer(body, dtype, count)
        case ["ascii"]:
            points = _parse_text(body, dtype, count, len(lines), path)
        case other:
            problem = f"DATA {' '.join(other)} is not read; wanted ascii or binary"
            raise FormatError(problem, where=str(path), hint="save the cloud uncompressed")
    return _arrays(points, path)


def _layout(header: dict[str, list[str]], path: Path) -> tuple[np.dtype[Any], int]:
    """Type of one point and number of points."""
    missing = [key for key in ("FIELDS", "SIZE", "TYPE", "POINTS", "DATA") if not header.get(key)]
    if missing:
        raise FormatError(f"the header lacks {', '.join(missing)}", where=str(path))
    names, sizes, kinds = header["FIELDS"], header["SIZE"], header["TYPE"]
    counts = header.get("COUNT", ["1"] * len(names))
    if not len(names) == len(sizes) == len(kinds) == len(counts):
        raise FormatError("FIELDS, SIZE, TYPE and COUNT differ in length", where=str(path))
    try:
        fields: list[Any] = [
            (f"{name} {i}" if name == "_" else name, f"<{_KINDS[kind]}{int(size)}", (int(repeat),))
            for i, (name, size, kind, repeat) in enumerate(zip(names, sizes, kinds, counts, strict=True))
        ]
        dtype, count = np.dtype(fields), int(header["POINTS"][0])
    except (KeyError, ValueError, TypeError) as e:
        raise FormatError(f"the header is not understood: {e}", where=str(path)) from None
    if count < 1 or dtype.itemsize == 0:
        raise FormatError(f"{count} points of {dtype.itemsize} bytes", where=str(path))
    return dtype, count


def _parse_text(body: bytes, dtype: np.dtype[Any], count: int, header_lines: int, path: Path) -> NDArray[Any]:
    """ASCII points as the same structured array."""
    numbered = [
        (line, i) for i, line in enumerate(body.decode("latin-1").splitlines(), header_lines + 1) if line.strip()
    ]
    if len(numbered) != count:
        problem = f"{count} points promised, {len(numbered)} lines follow"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    rows = parse_rows([line for line, _ in numbered], [i for _, i in numbered], path)
    widths = [dtype[name].shape[0] for name in dtype.names or ()]
    if rows.shape[1] != sum(widths):
        raise FormatError(f"{rows.shape[1]} numbers in a line, {sum(widths)} in the header", where=str(path))
    points = np.empty(count, dtype)
    for name, block in zip(dtype.names or (), np.split(rows, np.cumsum(widths)[:-1], axis=1), strict=True):
        points[name] = block
    return points


def _arrays(points: NDArray[Any], path: Path) -> Arrays:
    """Pick coordinates, normals and colours."""
    names = points.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(f"points have no x, y, z; found {', '.join(names)}", where=str(path))

    def columns(*wanted: str) -> NDArray[np.float64]:
        return np.concatenate([points[name][:, :1] for name in wanted], axis=1).astype(np.float64)

    arrays: Arrays = {"vertices": columns("x", "y", "z")}
    if {"normal_x", "normal_y", "normal_z"} <= set(names):
        arrays["normals"] = columns("normal_x", "normal_y", "normal_z")
    packed = next((name for name in ("rgb", "rgba") if name in names and points.dtype[name].base.itemsize == 4), None)
    if packed:
        bits = np.ascontiguousarray(points[packed][:, 0]).view("<u4")
        arrays["colors"] = np.stack([bits >> 16 & 255, bits >> 8 & 255, bits & 255], axis=1).astype(np.uint8)
    kept = ~np.isnan(arrays["vertices"]).any(axis=1)
    notes = [f"dropped {np.sum(~kept)} points without a reading (NaN)"] if not kept.all() else []
    return {**{name: values[kept] for name, values in arrays.items()}, "notes": np.array(notes, dtype=np.str_)}
