"""A panel whose corners are moved: curves, notches, grain, lines inside and the cut line come along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, InnerLine, Notch, Panel
from vto_pipeline.numerics.plane_curves import at_shares, flatten

_FLAT_M = 1e-4
_SAMPLES = 200  # of an edge, where a notch is looked for
_TOUCHING = 1e-9


def moved_edge(edge: Edge, start: FloatArray, end: FloatArray) -> Edge:
    """Return an edge whose ends are moved, and all between them in proportion; an arc stays one of the same angle.

    Args:
        edge: The edge.
        start, end: Moves of its ends [m], shape (2,).
    """
    if edge.kind == "polyline":
        ways = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(edge.points, axis=0), axis=1))])
        share = ways / ways[-1]
    else:
        share = np.linspace(0.0, 1.0, len(edge.points))
    return replace(edge, points=edge.points + (1.0 - share)[:, None] * start + share[:, None] * end)


def moved_panel(panel: Panel, moves: FloatArray, size: str) -> Panel:
    """Return a panel whose corners are moved.

    Args:
        panel: The panel.
        moves: Of the start of each edge, in the panel's plane [m], shape (E, 2).
        size: Its name in the new panel.
    """
    ends = np.roll(moves, -1, axis=0)
    edges = tuple(moved_edge(e, a, b) for e, a, b in zip(panel.edges, moves, ends, strict=True))
    inside = _Inside(panel.edges, edges)
    grain = panel.grain if panel.grain is None else panel.grain + inside.moves(panel.grain.mean(axis=0)[None])
    return replace(
        panel,
        edges=edges,
        size=size,
        grain=grain,  # shifted, not turned: the warp keeps its direction
        notches=tuple(_moved_notch(notch, panel.edges, edges) for notch in panel.notches),
        lines=tuple(InnerLine(one.kind, tuple(inside.moved(e) for e in one.curves)) for one in panel.lines),
        drills=None if panel.drills is None else panel.drills + inside.moves(panel.drills),
        cut=tuple(inside.moved_beside(e) for e in panel.cut),
        placement=panel.placement and replace(panel.placement, worn_at=None),  # that size was not worn
    )


def _moved_notch(notch: Notch, before: tuple[Edge, ...], after: tuple[Edge, ...]) -> Notch:
    """Return a notch at the same share of the length of its edge, and as far off it, so that both sides still match."""
    shares = np.linspace(0.0, 1.0, _SAMPLES + 1)
    places = [at_shares(e.kind, e.points, e.bulge, shares) for e in before]
    number, sample = min(
        ((k, int(np.argmin(np.linalg.norm(place - notch.position, axis=1)))) for k, place in enumerate(places)),
        key=lambda found: float(np.linalg.norm(places[found[0]][found[1]] - notch.position)),
    )
    share = _share_near(before[number], notch.position, shares[sample])
    old, new = (at_shares(e.kind, e.points, e.bulge, np.array([share]))[0] for e in (before[number], after[number]))
    angle = notch.angle
    if angle is not None:
        chords = [e.points[-1] - e.points[0] for e in (before[number], after[number])]
        turns = [float(np.arctan2(chord[1], chord[0])) for chord in chords]
        angle += turns[1] - turns[0]
    return replace(notch, position=notch.position + new - old, angle=angle)


def _share_near(edge: Edge, place: FloatArray, share: float) -> float:
    """Return the share of an edge's length nearest to a place, from one near it, by ever closer samples."""
    reach = 1.0 / _SAMPLES
    for _ in range(3):
        tried = np.clip(share + reach * np.linspace(-1.0, 1.0, 41), 0.0, 1.0)
        away = np.linalg.norm(at_shares(edge.kind, edge.points, edge.bulge, tried) - place, axis=1)
        share, reach = float(tried[np.argmin(away)]), reach / 20.0
    return share


class _Inside:
    """How points inside an outline move with it.

    Args:
        before, after: The outline.
    """

    def __init__(self, before: tuple[Edge, ...], after: tuple[Edge, ...]) -> None:
        self._outline = edges_points(before, _FLAT_M)[:-1]
        shares = [_shares(e) for e in before]
        places = [at_shares(e.kind, e.points, e.bulge, s)[:-1] for e, s in zip(after, shares, strict=True)]
        self._moves = np.concatenate(places) - self._outline

    def moves(self, points: FloatArray) -> FloatArray:
        """Return the moves of points, by mean value coordinates (Floater 2003), shape (N, 2)."""
        found = np.empty_like(points)
        for k, point in enumerate(points):
            to = self._outline - point
            far = np.linalg.norm(to, axis=1)
            if far.min() < _TOUCHING:
                found[k] = self._moves[int(np.argmin(far))]
                continue
            ahead = np.roll(to, -1, axis=0)
            cross = to[:, 0] * ahead[:, 1] - to[:, 1] * ahead[:, 0]
            half = np.tan(0.5 * np.arctan2(cross, (to * ahead).sum(axis=1)))
            weight = (half + np.roll(half, 1)) / far
            found[k] = weight @ self._moves / weight.sum()
        return found

    def moved(self, edge: Edge) -> Edge:
        """Return a line inside, moved."""
        return replace(edge, points=edge.points + self.moves(edge.points))

    def moved_beside(self, edge: Edge) -> Edge:
        """Return a line outside, as far from the outline as it was."""
        sides = np.roll(self._outline, -1, axis=0) - self._outline
        to = edge.points[:, None] - self._outline  # (N, sides of the outline, 2)
        share = np.clip((to * sides).sum(axis=2) / (sides**2).sum(axis=1), 0.0, 1.0)
        nearest = np.linalg.norm(to - share[:, :, None] * sides, axis=2).argmin(axis=1)
        t = np.take_along_axis(share, nearest[:, None], axis=1)
        ends = np.roll(self._moves, -1, axis=0)[nearest]
        return replace(edge, points=edge.points + (1.0 - t) * self._moves[nearest] + t * ends)


def _shares(edge: Edge) -> FloatArray:
    """Return the shares of its length at which an edge is flattened."""
    ways = np.linalg.norm(np.diff(flatten(edge.kind, edge.points, edge.bulge, _FLAT_M), axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(ways)])
    return np.asarray(at / at[-1])
