"""Patterns as DXF files of release 12 after AAMA-292 and ASTM D6673: a block for each piece and size; in mm."""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.io.files import replacing
from vto_pipeline.io.patterns.dxf import layers, placement_text, remarks
from vto_pipeline.io.patterns.dxf.stitch_texts import text_of
from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, Panel, Pattern
from vto_pipeline.numerics.plane_curves import flatten

CURVE_M = 1e-5
"""How far the straight pieces of a curve may leave it."""

_MM = 1e3
_TEXT_MM = 5.0
_LAYER_OF_NOTCH = {kind: layer for layer, kind in layers.NOTCH_KINDS.items()} | {"v": layers.NOTCHES}
_LAYER_OF_LINE = {kind: layer for layer, kind in layers.LINE_KINDS.items()} | {
    "sew": layers.SEW,
    "mirror": layers.MIRROR,
}
_ESCAPED = re.compile(r"\\(?=[UM]\+)")  # a backslash that a reader would take for the start of an escape
_CARET = ord("^")  # readers drop it at the end of a text, or take the next letter for a control character


def write_dxf(path: Path, pattern: Pattern) -> None:
    """Write a pattern.

    Curves become polylines within `CURVE_M`, with turn points at the ends of edges and curve points between. Stitches
    and where panels stand in space are texts, as the standard has no place for them.

    Args:
        path: The file.
        pattern: Any.
    """
    import ezdxf
    from ezdxf.addons import gerber_D6673

    logging.getLogger("ezdxf").setLevel(logging.ERROR)  # it warns that release 12 has no unit, which a text says
    document = ezdxf.new("R12")
    space = document.modelspace()
    sizes = [size for size in pattern.sizes if size]
    heads = [f"STYLE NAME: {pattern.name}", "UNITS: METRIC", *(f"SAMPLE SIZE: {size}" for size in sizes[:1])]
    heads += [placement_text.WORN] if pattern.worn else []
    for number, text in enumerate((*heads, *map(text_of, pattern.stitches))):
        _text(space, text, layers.BOUNDARY, (0.0, -2.0 * _TEXT_MM * (number + 1)))
    for number, panel in enumerate(pattern.panels):
        block = document.blocks.new(_block_name(number, panel))
        _draw(block, panel)
        space.add_blockref(block.name, (0.0, 0.0), dxfattribs={"layer": str(layers.BOUNDARY)})
    with replacing(path) as beside, beside.open("w", encoding="ascii", errors="dxfreplace") as stream:
        gerber_D6673.export_stream(document, stream)


def _block_name(number: int, panel: Panel) -> str:
    """Return a name that every reader takes: letters, digits and underscores, unique by its number."""
    text = f"{panel.name}_{panel.size}" if panel.size else panel.name
    return f"P{number + 1}_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in text)[:40]


def _draw(block: Any, panel: Panel) -> None:
    words = [f"PIECE NAME: {panel.name}", *([f"SIZE: {panel.size}"] if panel.size else []), *panel.notes]
    if panel.placement is not None:
        words.append(placement_text.text_of(panel.placement))
    words += remarks.texts_of(panel)
    middle = _MM * edges_points(panel.edges, CURVE_M).mean(axis=0)
    for number, text in enumerate(words):
        _text(block, text, layers.BOUNDARY, (middle[0], middle[1] - 2.0 * _TEXT_MM * number))
    outer = panel.cut or panel.edges
    _line(block, outer, layers.BOUNDARY, closed=True)
    _marks(block, outer)
    if panel.cut:
        _line(block, panel.edges, layers.SEW, closed=True)
        _marks(block, panel.edges)
    if panel.grain is not None:
        start, end = _MM * panel.grain
        block.add_line(tuple(start), tuple(end), dxfattribs={"layer": str(layers.GRAIN)})
    for line in panel.lines:
        closed = bool((line.curves[0].points[0] == line.curves[-1].points[-1]).all())
        _line(block, line.curves, _LAYER_OF_LINE.get(line.kind, layers.INTERNAL), closed=closed)
    for notch in panel.notches:
        attributes: dict[str, Any] = {"layer": str(_LAYER_OF_NOTCH.get(notch.kind, layers.NOTCHES))}
        attributes["thickness"] = _MM * notch.depth
        if notch.angle is not None:
            attributes["angle"] = float(np.rad2deg(notch.angle)) or 360.0  # ezdxf leaves out what is 0
        block.add_point(tuple(_MM * notch.position), dxfattribs=attributes)
    for place in () if panel.drills is None else panel.drills:
        block.add_point(tuple(_MM * place), dxfattribs={"layer": str(layers.DRILLS)})


def _line(block: Any, edges: Sequence[Edge], layer: int, *, closed: bool) -> None:
    points = _MM * edges_points(edges, CURVE_M)
    rows = [tuple(point) for point in (points[:-1] if closed else points)]
    block.add_polyline2d(rows, close=closed, dxfattribs={"layer": str(layer)})


def _marks(block: Any, edges: Sequence[Edge]) -> None:
    """Draw a turn point at the start of each edge, and curve points between."""
    for edge in edges:
        flat = _MM * flatten(edge.kind, edge.points, edge.bulge, CURVE_M)
        _points(block, flat[:1], layers.TURN_POINTS)
        _points(block, flat[1:-1], layers.CURVE_POINTS)


def _points(block: Any, points: FloatArray, layer: int) -> None:
    for point in points:
        block.add_point(tuple(point), dxfattribs={"layer": str(layer)})


def _text(block: Any, text: str, layer: int, place: tuple[float, float]) -> None:
    block.add_text(_ascii(text), height=_TEXT_MM, dxfattribs={"layer": str(layer), "style": "STANDARD"}).set_placement(
        place
    )


def _ascii(text: str) -> str:
    """Return a text in seven bits and one line, other letters as DXF escapes them: by two where UTF-16 takes two."""
    units = np.frombuffer(_ESCAPED.sub("\\\\U+005C", text).encode("utf-16-le", "surrogatepass"), "<u2").tolist()
    return "".join(chr(unit) if 0x20 <= unit < 0x7F and unit != _CARET else f"\\U+{unit:04X}" for unit in units)
