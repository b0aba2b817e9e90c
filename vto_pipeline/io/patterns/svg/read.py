"""Patterns from SVG files: ours, marked with what is what, and drawings by others, of which closed lines are panels."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.patterns.record import answer, pattern_of
from vto_pipeline.io.patterns.svg import names
from vto_pipeline.io.patterns.svg.panels import drawn_pattern
from vto_pipeline.io.patterns.svg.shapes import Drawing, Drawn, read_drawing
from vto_pipeline.model.pattern import Edge


def parse_svg(path: str, unit: str) -> Arrays:
    """Return the pattern of an SVG file as our JSON in text. Runs in the sandbox.

    Args:
        path: The file.
        unit: Of its user space, in place of what the file says, or empty.

    Raises:
        InputError: the drawing has no true size; FormatError: not SVG, or no line is a panel.
    """
    where = Path(path).name
    notes: list[str] = []
    try:
        drawing = read_drawing(Path(path), unit)
        if names.SCHEMA in drawing.root:
            return answer(pattern_of(_own(drawing), where), notes)
        return answer(drawn_pattern(drawing, Path(path).stem, notes), notes)
    except InputError as e:
        raise type(e)(e.problem, where=e.where or where, hint=e.hint) from None


def _own(drawing: Drawing) -> dict[str, Any]:
    """Return the record of a pattern that `write_svg` wrote."""
    panels: dict[int, dict[str, Any]] = {}
    try:
        head = json.loads(drawing.root[names.HEAD])
        x, y = head.pop("origin")
        for line in drawing.lines:
            if names.ROLE in line.attributes:
                number = int(line.attributes[names.PANEL])
                _add(panels.setdefault(number, {"notches": [], "drills": [], "lines": []}), _moved(line, x, y))
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as e:
        raise FormatError(f"the marks of a pattern of ours are damaged: {type(e).__name__}: {e}"[:120]) from None
    return {"schema": 1, "unit": "m", "panels": [panels[k] for k in sorted(panels)], **head}


def _moved(line: Drawn, x: float, y: float) -> Drawn:
    """Return a line with the corner of the page at a place [m]."""
    return replace(line, edges=tuple(replace(edge, points=edge.points + np.array([x, y])) for edge in line.edges))


def _add(panel: dict[str, Any], line: Drawn) -> None:
    """Add a line to the record of its panel."""
    role = line.attributes[names.ROLE]
    detail = json.loads(line.attributes.get(names.DETAIL, "null"))
    start, end = line.edges[0].points[0].tolist(), line.edges[-1].points[-1].tolist()
    if role == "outline":
        panel |= json.loads(line.attributes[names.RECORD])
        panel["edges"] = _edges(line.edges, detail)
    elif role == "cut":
        panel["cut"] = _edges(line.edges, detail)
    elif role == "grain":
        panel["grain"] = [start, end]
    elif role == "notch":
        panel["notches"].append({"position": start, **detail})
    elif role == "drill":
        panel["drills"].append(start)
    else:
        panel["lines"].append({"kind": role, "curves": _edges(line.edges, detail)})


def _edges(segments: Sequence[Edge], detail: Sequence[tuple[int, str, float]]) -> list[dict[str, Any]]:
    """Return segments as edges, of which each has a count of segments, a label and a bulge."""
    edges = []
    at = 0
    for count, label, bulge in detail:
        part = segments[at : at + count]
        points = part[0].points.tolist() + [p for one in part[1:] for p in one.points[1:].tolist()]
        edges.append({"kind": part[0].kind, "points": points, "bulge": bulge, "label": label})
        at += count
    return edges
