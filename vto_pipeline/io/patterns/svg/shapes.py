"""What an SVG file draws, as curves in metres with y up: transforms, units and references resolved."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.loops import JOIN_M
from vto_pipeline.model.pattern import Edge
from vto_pipeline.units import LENGTH_M

_PX_M = 0.0254 / 96.0  # CSS Values 3, section 6.2
_CSS_M = {"": _PX_M, "px": _PX_M, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0, "mm": 1e-3, "cm": 1e-2, "in": 0.0254}
_LENGTH = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(px|pt|pc|mm|cm|in|)\s*")
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_ROUND = 1e-9  # of the radii: less apart, and an ellipse is a circle
_CURVES = 24  # cubic curves a whole ellipse is made of


@dataclass(frozen=True)
class Drawn:
    """One line: a shape, or a part of a path between two moves.

    Args:
        name: Id or label, and the part if there are several, for messages.
        edges: A segment each [m]; none for a point.
        closed: Whether the file closes it, or it ends where it starts.
        attributes: Of the element and those around it.
    """

    name: str
    edges: tuple[Edge, ...]
    closed: bool
    attributes: dict[str, str]


@dataclass(frozen=True)
class Drawing:
    """A whole file.

    Args:
        lines: In the order of painting.
        texts: Place [m] and words.
        unit: How the scale is known.
        root: Attributes of the root.
        skipped: Kinds of elements that are not lines.
    """

    lines: tuple[Drawn, ...]
    texts: tuple[tuple[tuple[float, float], str], ...]
    unit: str
    root: dict[str, str]
    skipped: tuple[str, ...]


def read_drawing(path: Path, unit: str) -> Drawing:
    """Return what a file draws.

    Args:
        path: The file.
        unit: Of its user space, in place of what width and viewBox say; empty: as they say.

    Raises:
        InputError: it has no size; FormatError: it is not SVG.
    """
    import svgelements

    root = _root(path)
    try:
        svg = svgelements.SVG.parse(str(path), ppi=96.0)
    except (ET.ParseError, ValueError, TypeError, IndexError, KeyError, AttributeError, RecursionError) as e:
        raise FormatError(f"not an SVG file that can be read: {type(e).__name__}: {e}"[:200]) from None
    if not isinstance(svg, svgelements.SVG):
        raise FormatError("the root does not belong to SVG", hint='expected xmlns="http://www.w3.org/2000/svg"')
    scale, how = _scale(svg, root, unit)
    lines: list[Drawn] = []
    texts = []
    skipped: list[str] = []
    for element in svg.elements():
        attributes = {str(k): str(v) for k, v in (element.values or {}).items() if k != "attributes"}
        name = attributes.get("id") or attributes.get(_LABEL) or f"{type(element).__name__} {len(lines) + 1}"
        if isinstance(element, svgelements.Shape):
            lines += _lines(svgelements.Path(element), name, scale, attributes)
        elif isinstance(element, svgelements.Text):
            if element.text:
                x, y = element.transform.point_in_matrix_space((element.x, element.y))
                texts.append(((scale * float(x), -scale * float(y)), str(element.text).strip()))
        elif isinstance(element, svgelements.Image):
            skipped.append(f"image {name}")
    return Drawing(tuple(lines), tuple(texts), how, root, tuple(skipped))


def _root(path: Path) -> dict[str, str]:
    """Return the attributes of the root element."""
    try:
        _, element = next(iter(ET.iterparse(path, events=("start",))))
    except (ET.ParseError, StopIteration, ValueError, LookupError) as e:
        raise FormatError(f"not XML: {e}") from None
    if element.tag.rpartition("}")[2] != "svg":
        raise FormatError(f"the root is <{element.tag[:40]}>; expected <svg>")
    return dict(element.attrib)


def _scale(svg: Any, root: dict[str, str], unit: str) -> tuple[float, str]:
    """Return metres per unit of what svgelements returns, and how that is known.

    svgelements turns lengths into pixels with rounded constants; the exact width of the file corrects that.
    """
    if unit:
        box = root.get("viewBox", "").replace(",", " ").split()
        try:
            per_user = float(svg.width) / float(box[2]) if len(box) == 4 else 1.0
            return LENGTH_M[unit] / per_user, f"{unit}, as requested"
        except (ValueError, ZeroDivisionError):
            raise FormatError(f"viewBox is {root['viewBox']!r}; expected four numbers, the last two positive") from None
    found = _LENGTH.fullmatch(root.get("width", ""))
    if found is None or float(found[1]) <= 0.0 or not svg.width:
        problem = f"the drawing has no true size: its width is {root.get('width', 'absent')!r}"
        raise InputError(problem, hint="give the unit of its coordinates: --unit mm")
    metres = float(found[1]) * _CSS_M[found[2]]
    how = (
        f"width {root['width']}" if found[2] not in ("", "px") else f"width {root['width']}, 96 pixels an inch assumed"
    )
    return metres / float(svg.width), how


def _lines(path: Any, name: str, scale: float, attributes: dict[str, str]) -> list[Drawn]:
    """Return the parts of a path."""
    import svgelements

    parts = []
    for part in path.as_subpaths():
        segments = list(svgelements.Path(part))
        edges = [edge for segment in segments for edge in _edges(segment, scale)]
        if edges:
            gap = np.abs(edges[0].points[0] - edges[-1].points[-1]).max()
            closed = any(isinstance(one, svgelements.Close) for one in segments) or gap <= JOIN_M
            parts.append((edges, closed))
    many = len(parts) > 1
    return [
        Drawn(f"{name}, part {k + 1}" if many else name, tuple(edges), bool(closed), attributes)
        for k, (edges, closed) in enumerate(parts)
    ]


def _edges(segment: Any, scale: float) -> list[Edge]:
    """Return a segment as edges, none if it has no length."""
    import svgelements

    if isinstance(segment, svgelements.Move) or segment.start is None or segment.end is None:
        return []
    if isinstance(segment, svgelements.Arc):
        if not np.isfinite([segment.rx, segment.ry, segment.sweep]).all():
            raise FormatError("an arc whose radii or angle are not finite")
        if abs(segment.rx - segment.ry) <= _ROUND * segment.rx and 0.0 < abs(segment.sweep) < 2.0 * np.pi - 1e-6:
            ends = _points([segment.start, segment.end], scale)
            bulge = -float(np.tan(segment.sweep / 4.0))  # y is up here
            return [Edge("arc", ends, bulge)] if np.ptp(ends, axis=0).any() and bulge else []
        count = max(1, int(np.ceil(_CURVES * abs(segment.sweep) / (2.0 * np.pi))))
        return [edge for curve in segment.as_cubic_curves(count) for edge in _edges(curve, scale)]
    controls = [
        point for key in ("control", "control1", "control2") if (point := getattr(segment, key, None)) is not None
    ]
    points = _points([segment.start, *controls, segment.end], scale)
    if not np.isfinite(points).all() or not np.ptp(points, axis=0).any():
        return []
    return [Edge("bezier" if controls else "polyline", points)]


def _points(points: list[Any], scale: float) -> Any:
    return np.array([[scale * p.x, -scale * p.y] for p in points], dtype=np.float64)
