"""OFF: a line with the counts, the vertices, the polygons."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.formats.polygons import CUT_OFF, triangulate_polygons
from vto_pipeline.io.text_numbers import parse_numbers, parse_rows, read_lines


def parse_off(name: str) -> Arrays:
    """Read an OFF file; colours after the coordinates or the corners are ignored.

    Args:
        name: Path of the file.

    Returns:
        vertices (V, 3); faces (F, 3); notes.

    Raises:
        FormatError: the file breaks the format, or its counts do not fit its lines.
    """
    path = Path(name)
    numbered = [(line.split("#", 1)[0].strip(), i) for i, line in enumerate(read_lines(path), start=1)]
    numbered = [(line, i) for line, i in numbered if line]
    if not numbered or numbered[0][0].split()[0] not in ("OFF", "COFF"):
        raise FormatError("does not begin with OFF", where=str(path), hint="NOFF, STOFF and binary are not supported")
    if numbered[0][0] in ("OFF", "COFF"):
        numbered = numbered[1:]
    else:  # the counts may stand on the first line
        numbered[0] = (numbered[0][0].split(None, 1)[1], numbered[0][1])
    lines, at = [line for line, _ in numbered], [i for _, i in numbered]
    counts = parse_numbers(lines[:1], at[:1], path)
    if len(counts) < 2 or not (counts >= 0).all() or not (counts[:2] == counts[:2].astype(np.int64)).all():
        raise FormatError("the counts of vertices and faces are missing", where=str(path))
    vertices, faces = int(counts[0]), int(counts[1])
    if vertices + faces != len(lines) - 1:
        problem = f"the header promises {vertices} vertices and {faces} faces, but {len(lines) - 1} lines follow"
        raise FormatError(problem, where=str(path), hint=CUT_OFF)
    if vertices == 0 or faces == 0:
        raise FormatError(f"{vertices} vertices and {faces} faces", where=str(path))
    points = parse_rows(lines[1 : 1 + vertices], at[1 : 1 + vertices], path)
    if points.shape[1] < 3:
        raise FormatError(f"vertices have {points.shape[1]} coordinates", where=str(path))
    triangles, notes = triangulate_polygons(_polygons(lines[1 + vertices :], at[1 + vertices :], path), path)
    return {"vertices": points[:, :3], "faces": triangles, "notes": np.array(notes, dtype=np.str_)}


def _polygons(lines: list[str], at: list[int], path: Path) -> list[np.ndarray]:
    """Polygons grouped by their number of corners, in order of that number."""
    sides = parse_numbers([line.split(None, 1)[0] for line in lines], at, path)
    groups = []
    for n in np.unique(sides):
        chosen = np.flatnonzero(sides == n)
        corners = int(n) if np.isfinite(n) else 0
        rows = [lines[i].split()[1 : 1 + corners] for i in chosen]
        short = next((at[i] for i, row in zip(chosen, rows, strict=True) if len(row) < corners or corners < 1), None)
        if short is not None:
            raise FormatError(f"a face of {n:g} corners has fewer indices", where=f"{path}, line {short}", hint=CUT_OFF)
        groups.append(parse_rows([" ".join(row) for row in rows], [at[i] for i in chosen], path))
    return groups
