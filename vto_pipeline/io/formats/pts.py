"""PTS, Leica's text format: a count, then a point per line with its intensity and colour; several scans in a row."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF
from vto_pipeline.io.text_numbers import parse_rows, read_lines

_COLOR_AT = {3: None, 4: None, 6: 3, 7: 4}  # columns of a line -> where its colour begins


def parse_pts(name: str) -> Arrays:
    """Read a PTS file.

    Args:
        name: Path of the file.

    Returns:
        vertices (N, 3); colors (N, 3) uint8, where given.

    Raises:
        FormatError: a line is not a point, or there are not as many as promised.
    """
    path = Path(name)
    numbered = [(line.strip(), i) for i, line in enumerate(read_lines(path), start=1) if line.strip()]
    heads = [line for line, _ in numbered if " " not in line and "\t" not in line]
    points = [(line, i) for line, i in numbered if " " in line or "\t" in line]
    if not heads or not all(head.isdecimal() for head in heads) or numbered[0][0] != heads[0]:
        raise FormatError("a PTS file begins with the number of its points", where=str(path))
    promised = sum(map(int, heads))
    if promised != len(points) or not points:
        raise FormatError(f"{promised} points promised, {len(points)} lines follow", where=str(path), hint=CUT_OFF)
    rows = parse_rows([line for line, _ in points], [i for _, i in points], path)
    if rows.shape[1] not in _COLOR_AT:
        problem = f"{rows.shape[1]} numbers in a line; expected x y z, then intensity, colour or both"
        raise FormatError(problem, where=str(path))
    arrays: Arrays = {"vertices": rows[:, :3]}
    at = _COLOR_AT[rows.shape[1]]
    if at is not None:
        colors = rows[:, at : at + 3]
        if not ((colors >= 0) & (colors <= 255)).all():
            raise FormatError("a colour is not in 0 to 255", where=str(path))
        arrays["colors"] = colors.astype(np.uint8)
    return arrays
