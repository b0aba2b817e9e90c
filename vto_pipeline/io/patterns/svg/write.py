"""Patterns as SVG at true size, in millimetres; marked so that they are read back whole."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from vto_pipeline.io.files import replacing
from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.io.patterns.record import record_of
from vto_pipeline.io.patterns.svg import names
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, Panel, Pattern

_MM = 1e3
_MARGIN_M = 0.02  # around the panels
_FLAT_M = 1e-4  # of outlines, for the size of the page
_STYLES = {
    "outline": "stroke:#000000;stroke-width:0.5",
    "cut": "stroke:#808080;stroke-width:0.5",
    "grain": "stroke:#0060c0;stroke-width:0.4",
    "notch": "stroke:#c00000;stroke-width:0.6",
    "drill": "stroke:#c00000;stroke-width:0.4",
}
_INNER = "stroke:#606060;stroke-width:0.3;stroke-dasharray:4 2"
_NOTCH_M = 5e-3  # how long a notch of unknown depth is drawn
_DRILL_M = 1e-3  # half of the cross that marks a drill hole, whose first point is its middle


def write_svg(path: Path, pattern: Pattern) -> None:
    """Write a pattern, panels where their coordinates have them.

    Args:
        path: The file.
        pattern: Any; panels of several sizes lie over each other, as nests are drawn.
    """
    record = record_of(pattern)
    points = np.concatenate([edges_points((*p.edges, *p.cut), _FLAT_M) for p in pattern.panels])
    low, high = points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M
    width, height = (_MM * (high - low)).tolist()
    x, y = float(_MM * low[0]), float(-_MM * high[1])
    head = {"name": pattern.name, "source_unit": pattern.unit, "worn": pattern.worn, "stitches": record["stitches"]}
    head["origin"] = [low[0], high[1]]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width!r}mm" height="{height!r}mm" '
        f'viewBox="{x!r} {y!r} {width!r} {height!r}" {names.SCHEMA}="1" {names.HEAD}={_json(head)}>',
        f"<title>{escape(pattern.name)}</title>",
    ]
    for number, panel in enumerate(pattern.panels):
        lines += _panel(number, panel, record["panels"][number])
    with replacing(path) as beside:
        beside.write_text("\n".join([*lines, "</svg>", ""]), encoding="utf-8")


def _panel(number: int, panel: Panel, record: dict[str, Any]) -> list[str]:
    """Return the elements of a panel."""
    said = {key: record[key] for key in ("name", "size", "placement", "notes")}
    mark = f'{names.PANEL}="{number}"'
    lines = [f'<g id={quoteattr(f"panel-{number}")} {mark} style="fill:none">']
    outline = f"{names.RECORD}={_json(said)} {names.DETAIL}={_json(_detail(panel.edges))}"
    lines.append(_element("outline", _path(panel.edges), outline))
    if panel.cut:
        lines.append(_element("cut", _path(panel.cut), f"{names.DETAIL}={_json(_detail(panel.cut))}"))
    for line in panel.lines:
        lines.append(_element(line.kind, _path(line.curves), f"{names.DETAIL}={_json(_detail(line.curves))}"))
    if panel.grain is not None:
        lines.append(_element("grain", f"M{_xy(panel.grain[0])} L{_xy(panel.grain[1])}"))
    for notch in panel.notches:
        angle = notch.angle or 0.0
        tip = notch.position + (notch.depth or _NOTCH_M) * np.array([np.cos(angle), np.sin(angle)])
        detail = {"angle": notch.angle, "depth": notch.depth, "kind": notch.kind}
        lines.append(_element("notch", f"M{_xy(notch.position)} L{_xy(tip)}", f"{names.DETAIL}={_json(detail)}"))
    for place in () if panel.drills is None else panel.drills:
        arms = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]]) * _DRILL_M
        lines.append(
            _element("drill", " ".join([f"M{_xy(place)}", *(f"L{_xy(place + a)} L{_xy(place)}" for a in arms)]))
        )
    middle = edges_points(panel.edges, _FLAT_M).mean(axis=0)
    title = f"{panel.name} {panel.size}".strip()
    lines.append(
        f'<text x="{_mm(middle[0])}" y="{_mm(-middle[1])}" style="font-size:8px;fill:#000000">{escape(title)}</text>'
    )
    return [*lines, "</g>"]


def _element(role: str, path: str, more: str = "") -> str:
    return f'<path {names.ROLE}={quoteattr(role)} style="{_STYLES.get(role, _INNER)}" d="{path}" {more}/>'


def _json(value: Any) -> str:
    return quoteattr(json.dumps(value, ensure_ascii=False))


def _detail(edges: Sequence[Edge]) -> list[tuple[int, str, float]]:
    """Return for each edge its number of segments, label and bulge."""
    return [(len(one.points) - 1 if one.kind == "polyline" else 1, one.label, one.bulge) for one in edges]


def _path(edges: Sequence[Edge]) -> str:
    """Return edges as path data; the last point is written even where it closes the path, so that nothing is lost."""
    parts = [f"M{_xy(edges[0].points[0])}"]
    for edge in edges:
        rest = edge.points[1:]
        if edge.kind == "arc":
            parts.append(_arc(edge))
        elif edge.kind == "bezier":
            parts.append(("Q" if len(rest) == 2 else "C") + " ".join(_xy(p) for p in rest))
        else:
            parts += [f"L{_xy(p)}" for p in rest]
    return " ".join(parts)


def _arc(edge: Edge) -> str:
    """Return an arc as SVG has it; seen with y down, anticlockwise is a sweep of 0."""
    bulge = abs(edge.bulge)
    chord = float(np.linalg.norm(edge.points[1] - edge.points[0]))
    radius = chord * (1.0 + bulge * bulge) / (4.0 * bulge)
    return f"A{_mm(radius)} {_mm(radius)} 0 {int(bulge > 1.0)} {int(edge.bulge < 0.0)} {_xy(edge.points[1])}"


def _xy(point: FloatArray) -> str:
    return f"{_mm(point[0])},{_mm(-point[1])}"


def _mm(metres: float) -> str:
    return repr(float(_MM * metres))
