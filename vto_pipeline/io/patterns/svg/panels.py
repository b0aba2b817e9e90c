"""Which lines of a drawing by others are panels: closed ones of some size that lie in no other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.patterns.loops import (
    JOIN_M,
    Chain,
    Joined,
    anticlockwise,
    edges_area,
    edges_length,
    edges_points,
    join,
    moved_ends,
)
from vto_pipeline.io.patterns.svg.shapes import Drawing, Drawn
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, InnerLine, Panel, Pattern
from vto_pipeline.numerics.plane_curves import curve_at

_LEAST_M2 = 4e-4  # of a panel: a pocket flap has ten times that, a letter less
_LEAST_WIDTH_M = 1e-2  # mean, of a panel: a pen stroke drawn as an area has less
_TOLERANCE_M = 1e-4  # of outlines, to tell what lies inside
_SPECK_M = 1e-5  # shorter edges are rounding
_REDRAW = "draw each panel's outline as one closed line, not as the area of a pen stroke, and check the drawing's scale"
_ASKED = 60  # points of a line of which it is asked whether they lie inside


def drawn_pattern(drawing: Drawing, name: str, notes: list[str]) -> Pattern:
    """Return the panels of a drawing.

    Args:
        drawing: What the file draws.
        name: Of the garment.
        notes: Receives what was not taken.

    Raises:
        FormatError: no line is a panel.
    """
    joined = join([Chain(line.name, _closed(line)) for line in drawing.lines])
    if joined.doubled:
        notes.append(f"drawn twice and left out once: {_listed(joined.doubled)}")
    areas = {loop.name: _panel_area(loop.edges) for loop in joined.loops}
    wide = sorted((loop for loop in joined.loops if areas[loop.name]), key=lambda loop: -areas[loop.name])
    small = [loop.name for loop in joined.loops if not areas[loop.name]]
    outer: list[tuple[Chain, FloatArray]] = []
    inner: dict[int, list[InnerLine]] = {}
    for loop in wide:
        holder = _holder(outer, loop.edges)
        if holder is None:
            outer.append((loop, edges_points(loop.edges, _TOLERANCE_M)))
        else:
            inner.setdefault(holder, []).append(InnerLine("internal", loop.edges))
    if not outer:
        raise FormatError(f"no line is a panel: {_why_none(joined)}", hint=_REDRAW)
    stray = []
    for line in (*joined.open, *joined.branching):
        holder = _holder(outer, line.edges)
        if holder is None:
            stray.append(line.name)
        else:
            inner.setdefault(holder, []).append(InnerLine("internal", line.edges))
    for names, why in (
        (small, "closed lines too small or too thin for panels"),
        (stray, "open lines that are inside no panel"),
        (drawing.skipped, "pictures"),
    ):
        if names:
            notes.append(f"not taken, {why}: {_listed(names)}")
    words = _words(drawing, outer)
    panels = [
        Panel(title, anticlockwise(loop.edges), lines=tuple(inner.get(k, ())), notes=words[k])
        for k, (title, (loop, _)) in enumerate(zip(_unique([loop.name for loop, _ in outer]), outer, strict=True))
    ]
    notes.append("SVG by others names no seams, notches or grain; right sides are taken to face the viewer")
    return Pattern(name, tuple(panels), unit=drawing.unit)


def _why_none(joined: Joined) -> str:
    """Return what keeps the closed line that encloses most, and the longest open one, from being panels."""
    said = []
    if joined.loops:
        most = max(joined.loops, key=lambda loop: abs(edges_area(loop.edges)))
        area, length = abs(edges_area(most.edges)), edges_length(most.edges)
        said.append(
            f"{len(joined.loops)} are closed, of which {most.name} encloses most, {1e4 * area:.3g} cm² and "
            f"{2e3 * area / length:.2g} mm wide on average, where a panel has {1e4 * _LEAST_M2:g} cm² and "
            f"{1e3 * _LEAST_WIDTH_M:g} mm"
        )
    loose = (*joined.open, *joined.branching)
    if loose:
        longest = max(loose, key=lambda chain: edges_length(chain.edges))
        gap = 1e3 * float(np.linalg.norm(longest.start - longest.end))
        said.append(
            f"{len(loose)} are open, of which {longest.name} is the longest, "
            f"{1e3 * edges_length(longest.edges):.0f} mm, and ends {gap:.0f} mm from its start"
        )
    return "; ".join(said) or "nothing is drawn"


def _closed(line: Drawn) -> tuple[Edge, ...]:
    """Return the edges of a line without specks, with a straight one to its start where the file closes it without."""
    edges: list[Edge] = []
    for edge in line.edges:
        start = edges[-1].points[-1] if edges else edge.points[0]
        if np.ptp(edge.points, axis=0).max() > _SPECK_M:
            edges.append(moved_ends(edge, start, edge.points[-1]))
    if not edges:
        return line.edges
    start, end = edges[0].points[0], edges[-1].points[-1]
    if line.closed and np.abs(start - end).max() > JOIN_M:
        edges.append(Edge("polyline", np.stack([end, start])))
    return tuple(edges)


def _panel_area(edges: Sequence[Edge]) -> float:
    """Return the area of an outline [m²]; 0 where it is too small or too thin for a panel."""
    points = np.concatenate([edge.points for edge in edges])
    if np.prod(np.ptp(points, axis=0)) < _LEAST_M2:  # control points enclose their curves; arcs bulge out by some
        return 0.0
    area = abs(edges_area(edges))
    outline = np.linalg.norm(np.diff(edges_points(edges, _TOLERANCE_M), axis=0), axis=1).sum()
    return area if area >= _LEAST_M2 and 2.0 * area >= _LEAST_WIDTH_M * outline else 0.0


def _holder(outer: Sequence[tuple[Chain, FloatArray]], edges: Sequence[Edge]) -> int | None:
    """Return the panel in which all of a line lies, or None."""
    some = edges[:: max(1, len(edges) // _ASKED)]
    points = np.concatenate([curve_at(e.kind, e.points, e.bulge, np.array([0.0, 0.5])) for e in some])
    for k, (_, outline) in enumerate(outer):
        if _share_inside(outline, points) >= 0.9:  # a line drawn on to the outline may cross it at its ends
            return k
    return None


def _share_inside(outline: FloatArray, points: FloatArray) -> float:
    """Return how many of points (N, 2) an outline encloses: a ray from each crosses it an odd number of times."""
    a, b = outline[:-1], outline[1:]
    inside = 0
    for x, y in points:
        spans = (a[:, 1] > y) != (b[:, 1] > y)
        low, high = a[spans], b[spans]
        at = low[:, 0] + (y - low[:, 1]) / (high[:, 1] - low[:, 1]) * (high[:, 0] - low[:, 0])
        inside += int((at > x).sum() % 2)
    return inside / len(points)


def _words(drawing: Drawing, outer: Sequence[tuple[Chain, FloatArray]]) -> dict[int, tuple[str, ...]]:
    """Return the texts that stand in each panel."""
    words: dict[int, tuple[str, ...]] = dict.fromkeys(range(len(outer)), ())
    for place, text in drawing.texts:
        for k, (_, outline) in enumerate(outer):
            if text and _share_inside(outline, np.array([place])) == 1.0:
                words[k] = (*words[k], text)
                break
    return words


def _unique(names: Sequence[str]) -> list[str]:
    """Return names with a number where one is there twice."""
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return unique


def _listed(names: Sequence[str]) -> str:
    """Return some names, and how many more there are."""
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")
