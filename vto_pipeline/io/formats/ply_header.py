"""The header of a PLY file, and its element counts against the file's size."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.formats.polygons import CUT_OFF

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_HEADER_BYTES = 1_000_000
ARBITRARY = "lengths are arbitrary"
"""Comment in a file of unknown unit: a scan without a scale."""


@dataclass(frozen=True)
class Property:
    """One property of an element; `length` is the type of a list's length, None for a scalar."""

    name: str
    type: str
    length: str | None = None


@dataclass(frozen=True)
class Element:
    """A named table of the file."""

    name: str
    count: int
    properties: tuple[Property, ...]

    def smallest(self) -> int:
        """Least bytes of a record, with empty lists."""
        return sum(np.dtype(p.length or p.type).itemsize for p in self.properties)


@dataclass(frozen=True)
class Header:
    """The declared elements; the data starts at byte `start`, after `lines` lines; whether its unit is known."""

    order: str
    elements: tuple[Element, ...]
    start: int
    lines: int
    metric: bool = True


def read_header(data: bytes, path: Path) -> Header:
    """Parse the header and check its counts against the number of bytes that follow.

    Raises:
        FormatError: not a PLY header, or it promises more than the file holds.
    """
    end = data.find(b"end_header", 0, _HEADER_BYTES)
    stop = data.find(b"\n", end)
    if not data.startswith(b"ply") or end < 0 or stop < 0:
        raise FormatError("not a PLY file: no 'ply ... end_header'", where=str(path), hint=CUT_OFF)
    lines = data[:end].decode("latin-1").splitlines()
    order: str | None = None
    metric = True
    tables: list[tuple[str, int, list[Property]]] = []
    for number, line in enumerate(lines, start=1):
        words = line.split()
        match words:
            case ["format", kind, _] if kind in _ORDERS:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) < 16:
                tables.append((name, int(count), []))
            case ["property", "list", length, kind, name] if tables and length in _TYPES and kind in _TYPES:
                tables[-1][2].append(Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name] if tables and kind in _TYPES:
                tables[-1][2].append(Property(name, _TYPES[kind]))
            case ["comment", *words] if " ".join(words).startswith(ARBITRARY):
                metric = False
            case [] | ["ply"] | ["comment", *_] | ["obj_info", *_]:
                pass
            case _:
                raise FormatError(f"header line {line[:60]!r} is not understood", where=f"{path}, line {number}")
    if order is None:
        raise FormatError("header has no format line", where=str(path))
    header = Header(order, tuple(Element(n, c, tuple(p)) for n, c, p in tables), stop + 1, len(lines) + 1, metric)
    _check_promise(header, data, path)
    return header


def _check_promise(header: Header, data: bytes, path: Path) -> None:
    """Check the counts against the bytes, or for text the lines, after the header."""
    for element in header.elements:
        if element.count and not element.properties:
            raise FormatError(f"element {element.name} has no properties", where=str(path))
    promised = sum(e.count * (e.smallest() if header.order else 1) for e in header.elements)
    left = len(data) - header.start
    what = "bytes"
    if not header.order:
        left = data.count(b"\n", header.start) + (not data.endswith(b"\n"))
        what = "lines"
    if promised > left:
        counts = ", ".join(f"{e.count} x {e.name}" for e in header.elements)
        problem = f"the header promises {counts}: at least {promised} {what}, but only {left} follow"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
