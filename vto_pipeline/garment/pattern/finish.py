"""A pattern made ready for the cutter: grain lines, notches where seams match, cut lines outside by an allowance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.errors import ConfigError
from vto_pipeline.io.patterns.dxf.borders import split_at_borders
from vto_pipeline.io.patterns.loops import anticlockwise, edges_area, edges_length, edges_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, Notch, Panel, Pattern, Side, Stitch
from vto_pipeline.numerics.plane_curves import flatten

_FLAT_M = 1e-5  # how far straight pieces may leave a curve
_MITER = 2.0  # a corner's cut line goes out by so many allowances at most; sharper ones are cut off
_WIDEST_M = 0.1  # of an allowance: hems have half of it
_GRAIN = 0.8  # of the straight way through a panel's middle that is drawn as its grain line
_ON_IT_M = 1e-4  # from the cut line: a notch lies on it
_BESIDE_M = 0.01  # nearer to the end of an edge no notch is cut: the corner itself is matched there


def finished(pattern: Pattern, allowance: float) -> Pattern:
    """Return a pattern whose panels have all that a cutter needs; what a panel has already stays.

    A seam gets a notch in its middle, and where an edge ends on one side only. Both sides have it at the same share
    of their lengths. Notches lie on the cut line and point inwards, over half of the allowance.

    Args:
        pattern: In one size or more.
        allowance: From the outline to the cut line [m].

    Raises:
        ConfigError: the allowance is no length that cloth is sewn with.
    """
    if not 0.0 < allowance <= _WIDEST_M:
        problem = f"a seam allowance of {1e3 * allowance:g} mm; expected more than 0 and at most {1e3 * _WIDEST_M:g}"
        raise ConfigError(problem)
    notches: dict[tuple[str, str], list[Notch]] = {(panel.name, panel.size): [] for panel in pattern.panels}
    for size in pattern.sizes:
        of_size = pattern.of_size(size)
        panels = {panel.name: panel for panel in of_size.panels}
        for stitch in of_size.stitches:
            for name, notch in _seam_notches(stitch, panels, allowance):
                notches[name, size].append(notch)
    ready = tuple(_panel(panel, notches[panel.name, panel.size], allowance) for panel in pattern.panels)
    return replace(pattern, panels=ready)


def _panel(panel: Panel, notches: Sequence[Notch], allowance: float) -> Panel:
    """Return a panel with what it lacks; in a dart that the cut line passes over, no notch is cut."""
    cut = panel.cut or _cut_line(panel.edges, allowance)
    line = edges_points(cut, _FLAT_M)
    held = tuple(notch for notch in notches if _distance(notch.position, line) < _ON_IT_M)
    grain = _grain(panel) if panel.grain is None else panel.grain
    return replace(panel, grain=grain, notches=panel.notches or held, cut=cut)


def _distance(place: FloatArray, line: FloatArray) -> float:
    """Return how far a place is from a polyline [m]."""
    start, way = line[:-1], np.diff(line, axis=0)
    share = np.clip(((place - start) * way).sum(axis=1) / (way * way).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - place, axis=1).min())


def _cut_line(edges: Sequence[Edge], allowance: float) -> tuple[Edge, ...]:
    """Return the outline moved outwards; darts and other clefts that it fills are gone."""
    from manifold3d import CrossSection, FillRule, JoinType

    area = CrossSection([edges_points(edges, _FLAT_M)[:-1]], FillRule.Positive)
    loops = area.offset(allowance, JoinType.Miter, _MITER).to_polygons()
    lines = [(Edge("polyline", np.concatenate([loop, loop[:1]])),) for loop in _from_a_corner(loops)]
    return split_at_borders(anticlockwise(max(lines, key=edges_area)), np.zeros((0, 2)))


def _from_a_corner(loops: Sequence[FloatArray]) -> Iterator[FloatArray]:
    """Yield closed polylines that begin where they turn most, as a start counts as the end of an edge."""
    for loop in loops:
        before, after = loop - np.roll(loop, 1, axis=0), np.roll(loop, -1, axis=0) - loop
        turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1))
        yield np.roll(loop, -int(np.abs(turn).argmax()), axis=0)


def _grain(panel: Panel) -> FloatArray:
    """Return a line along y, which is the warp where no file says another, through the middle of a panel."""
    points = edges_points(panel.edges, _FLAT_M)
    x = float(0.5 * (points[:, 0].min() + points[:, 0].max()))
    a, b = points[:-1], points[1:]
    meets = (a[:, 0] > x) != (b[:, 0] > x)
    low, high = a[meets], b[meets]
    heights = np.sort(low[:, 1] + (x - low[:, 0]) / (high[:, 0] - low[:, 0]) * (high[:, 1] - low[:, 1]))
    start, end = max(heights.reshape(-1, 2), key=np.ptp)  # in and out by turns
    margin = 0.5 * (1.0 - _GRAIN) * (end - start)
    return np.array([[x, start + margin], [x, end - margin]])


def _seam_notches(stitch: Stitch, panels: Mapping[str, Panel], allowance: float) -> Iterator[tuple[str, Notch]]:
    """Yield the notches of both sides of a seam, with the panels that they are on."""
    ends = [_ends(chain, panels) for chain in (stitch.first, stitch.second)]
    shares = np.unique(np.round(np.concatenate([[0.5], *(one[1:-1] / one[-1] for one in ends)]), 6))
    for chain, at in zip((stitch.first, stitch.second), ends, strict=True):
        for place in shares * at[-1]:
            number = int(np.searchsorted(at, place, side="right")) - 1
            if min(place - at[number], at[number + 1] - place) >= _BESIDE_M:
                side = chain[number]
                edge = panels[side.panel].edges[side.edge]
                way = float(place - at[number])
                yield side.panel, _notch(edge, way if side.forward else edges_length([edge]) - way, allowance)


def _ends(chain: Sequence[Side], panels: Mapping[str, Panel]) -> FloatArray:
    """Return how far along a chain its edges begin, and its end [m], shape (K + 1,)."""
    return np.cumsum([0.0, *(edges_length([panels[side.panel].edges[side.edge]]) for side in chain)])


def _notch(edge: Edge, way: float, allowance: float) -> Notch:
    """Return the notch so far along an edge of an anticlockwise outline [m]."""
    points = flatten(edge.kind, edge.points, edge.bulge, _FLAT_M)
    ends = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    place = np.array([np.interp(way, ends, points[:, k]) for k in (0, 1)])
    piece = min(int(np.searchsorted(ends, way, side="right")) - 1, len(points) - 2)
    x, y = points[piece + 1] - points[piece]
    outwards = np.array([y, -x]) / np.hypot(x, y)
    return Notch(place + allowance * outwards, float(np.arctan2(-outwards[1], -outwards[0])), 0.5 * allowance)
