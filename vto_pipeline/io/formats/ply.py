"""PLY: ASCII or binary, mesh or cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.ply_header import Element, Header, Property, read_header
from vto_pipeline.io.formats.polygons import CUT_OFF, triangulate_polygons
from vto_pipeline.io.text_numbers import parse_numbers

_INDEX_NAMES = ("vertex_indices", "vertex_index")


def parse_ply(name: str) -> Arrays:
    """Read a PLY file.

    Args:
        name: Path of the file.

    Returns:
        vertices (V, 3); where given: faces (F, 3), normals (V, 3), colors (V, 3) uint8; notes; `arbitrary` where the
        file says that its unit is unknown.

    Raises:
        FormatError: the file breaks the format, or its counts do not fit its size.
    """
    path = Path(name)
    data = path.read_bytes()
    header = read_header(data, path)
    body = data[header.start :]
    order = header.order
    elements = header.elements
    if not order:  # text becomes a binary body whose every value is a double
        lines = body.decode("latin-1").splitlines()
        body = parse_numbers(lines, range(header.lines + 1, header.lines + 1 + len(lines)), path).tobytes()
        order = "="
        elements = tuple(
            Element(e.name, e.count, tuple(Property(p.name, "f8", p.length and "f8") for p in e.properties))
            for e in elements
        )
    offset = 0
    tables: dict[str, list[NDArray[Any]]] = {}
    for element in elements:
        tables[element.name], offset = _read_element(body, offset, element, order, path)
    if body[offset:].strip(b"\r\n\0 "):
        raise FormatError(f"{len(body) - offset} bytes are left over after the last element", where=str(path))
    return _arrays(header, tables, path)


def _read_element(body: bytes, offset: int, element: Element, order: str, path: Path) -> tuple[list[NDArray[Any]], int]:
    """Read all records as runs of records whose lists have the same lengths.

    Returns:
        One structured array per run, and the offset after the last.
    """
    runs: list[NDArray[Any]] = []
    left, window = element.count, element.count
    while left:
        dtype = _record_type(body, offset, element, order, path)
        fits = (len(body) - offset) // dtype.itemsize
        if fits == 0:
            raise FormatError(f"{element.name}: the data end {left} records early", where=str(path), hint=CUT_OFF)
        records = np.frombuffer(body, dtype, min(left, fits, window), offset)
        same = np.ones(len(records), dtype=bool)
        for field in dtype.names or ():
            if field.startswith("length of "):
                same &= records[field] == records[field][0]
        run = len(records) if same.all() else int(np.argmin(same))
        runs.append(records[:run])
        offset += run * dtype.itemsize
        left -= run
        window = max(2 * run, 16)  # mixed polygons come in short runs: look no further ahead than pays
    return runs, offset


def _record_type(body: bytes, offset: int, element: Element, order: str, path: Path) -> np.dtype[Any]:
    """The layout of the record at an offset; the length of a list is a field of its own, "length of NAME"."""
    fields: list[Any] = []
    for prop in element.properties:
        kind = np.dtype(order + prop.type)
        if prop.length is None:
            fields.append((prop.name, kind))
            continue
        length_kind = np.dtype(order + prop.length)
        here = offset + np.dtype(fields).itemsize
        if here + length_kind.itemsize > len(body):
            raise FormatError(f"{element.name}: the data end inside a record", where=str(path), hint=CUT_OFF)
        length = np.frombuffer(body, length_kind, 1, here)[0]
        if not 0 <= length <= (len(body) - here) // kind.itemsize or length != int(length):
            raise FormatError(f"{element.name}: a list claims {length} entries", where=str(path), hint=CUT_OFF)
        fields += [(f"length of {prop.name}", length_kind), (prop.name, kind, (int(length),))]
    try:
        return np.dtype(fields)
    except ValueError as e:
        raise FormatError(f"{element.name}: {e}", where=str(path)) from None


def _arrays(header: Header, tables: dict[str, list[NDArray[Any]]], path: Path) -> Arrays:
    """Pick vertices, faces, normals and colours out of the tables."""
    if len(tables.get("vertex", ())) != 1:
        problem = "vertices hold lists" if tables.get("vertex") else "there are no vertices"
        raise FormatError(problem, where=str(path))
    vertex = tables["vertex"][0]
    names = vertex.dtype.names or ()
    if not {"x", "y", "z"} <= set(names):
        raise FormatError(f"vertices have no x, y, z; found {', '.join(names)}", where=str(path))
    arrays: Arrays = {"vertices": _columns(vertex, ("x", "y", "z"))}
    if {"nx", "ny", "nz"} <= set(names):
        arrays["normals"] = _columns(vertex, ("nx", "ny", "nz"))
    if {"red", "green", "blue"} <= set(names):
        declared = next(p.type for e in header.elements if e.name == "vertex" for p in e.properties if p.name == "red")
        scale = 255.0 if declared.startswith("f") else 1.0
        arrays["colors"] = np.clip(_columns(vertex, ("red", "green", "blue")) * scale, 0, 255).round().astype(np.uint8)
    if any(e.name == "tristrips" and e.count for e in header.elements):
        raise FormatError("triangle strips are not supported", where=str(path), hint="write the mesh with plain faces")
    notes: list[str] = []
    if "face" in tables:
        groups = []
        for run in tables["face"]:
            field = next((n for n in _INDEX_NAMES if n in (run.dtype.names or ())), None)
            if field is None:
                raise FormatError("faces have no vertex_indices", where=str(path))
            groups.append(run[field])
        arrays["faces"], notes = triangulate_polygons(groups, path)
    if not header.metric:
        arrays["arbitrary"] = np.array(True)
    return {**arrays, "notes": np.array(notes, dtype=np.str_)}


def _columns(records: NDArray[Any], names: tuple[str, ...]) -> NDArray[np.float64]:
    return np.stack([records[name].astype(np.float64) for name in names], axis=1)
