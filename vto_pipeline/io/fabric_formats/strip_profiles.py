"""Profiles of hanging strips: a CSV of points whose header names the unit, such as x_mm,y_mm."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.files import check_file
from vto_pipeline.io.text_numbers import parse_rows, read_lines
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.units import LENGTH_M

_BYTES = 5_000_000
_HEADER = re.compile(r"x[_ \[(]*([a-z]+)[\])]*\s*([,;])\s*y[_ \[(]*([a-z]+)[\])]*", re.I)


def read_strip_profile(path: Path) -> FloatArray:
    """Read the points of a strip's profile, in the file's order.

    Args:
        path: CSV. A semicolon in the header means semicolons between columns and decimal commas.

    Returns:
        Points, +y up [m], shape (N, 2).

    Raises:
        InputError: no such file; FormatError: no header with a unit, or a line that is not two finite numbers.
    """
    path = check_file(Path(path), {".csv"}, _BYTES)
    lines = read_lines(path)
    first = next((number for number, line in enumerate(lines) if line.strip()), 0)
    head = _HEADER.fullmatch(lines[first].removeprefix("\ufeff").strip()) if lines else None
    units = (head[1].lower(), head[3].lower()) if head else ("", "")
    if head is None or not set(units) <= set(LENGTH_M):
        problem = f"the first line is {lines[first][:40] if lines else ''!r}; expected a header with units"
        raise FormatError(problem, where=f"{path}, line {first + 1}", hint="such as x_mm,y_mm")
    kept = [number for number in range(first + 1, len(lines)) if lines[number].strip()]
    plain = [_plain(lines[number], head[2]) for number in kept]
    points = parse_rows(plain, [number + 1 for number in kept], path)
    if points.shape[1:] != (2,) or not np.isfinite(points).all():
        raise FormatError("expected two finite numbers in each line", where=str(path))
    return points * [LENGTH_M[units[0]], LENGTH_M[units[1]]]


def _plain(line: str, delimiter: str) -> str:
    return line.replace(",", " ") if delimiter == "," else line.replace(",", ".").replace(";", " ")
