"""XYZ: a point per line, with a normal or a colour or both after the coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.text_numbers import parse_rows, read_lines


def parse_xyz(name: str) -> Arrays:
    """Read an XYZ file; commas and semicolons may stand between the numbers.

    Three further columns are a colour when they are whole numbers from 0 to 255, else a normal; six are both.

    Args:
        name: Path of the file.

    Returns:
        vertices (N, 3); normals (N, 3) and colors (N, 3) uint8, where given.

    Raises:
        FormatError: a line is not a point.
    """
    path = Path(name)
    numbered = [(line.strip(), i) for i, line in enumerate(read_lines(path), start=1)]
    numbered = [(line, i) for line, i in numbered if line and not line.startswith(("#", "//"))]
    if not numbered:
        raise FormatError("there are no points", where=str(path))
    separated = [(line.replace(", ", " ").replace(";", " "), i) for line, i in numbered]
    if separated[0][0].count(",") >= 2 and " " not in separated[0][0].strip():
        separated = [(line.replace(",", " "), i) for line, i in separated]
    rows = parse_rows([line for line, _ in separated], [i for _, i in separated], path)
    if rows.shape[1] not in (3, 6, 9):
        problem = f"{rows.shape[1]} numbers in a line; expected 3, 6 (normal or colour) or 9 (colour and normal)"
        raise FormatError(problem, where=str(path))
    arrays: Arrays = {"vertices": rows[:, :3]}
    for block in np.split(rows[:, 3:], (rows.shape[1] - 3) // 3, axis=1) if rows.shape[1] > 3 else []:
        whole = (block == np.trunc(block)).all() and (block >= 0).all() and (block <= 255).all()
        if whole and block.max() > 1:
            arrays["colors"] = block.astype(np.uint8)
        else:
            arrays["normals"] = block
    return arrays
