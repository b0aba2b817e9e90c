"""Outlines of panels from corners, and where they stand about the body."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vto_pipeline.garment.pattern.planned import SIDES
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, Panel, Pattern, Placement, Side, Stitch

Point = tuple[float, float]
Seam = tuple[Sequence[tuple[str, int]], Sequence[tuple[str, int]]]

_FILE_STATURE = 1.72  # m: where panels stand is said for a body of this height, as in GarmentCode's files


def piece(
    name: str,
    side: str,
    away: float,
    path: Sequence[Point | list[Point]],
    shift: Point = (0.0, 0.0),
    over: float | None = None,
) -> Panel:
    """Return a panel that stands upright beside the body.

    Args:
        name: Of the panel.
        side: "front", "back", "left" or "right" of the body, which is where its right side looks.
        away: From the body's middle [m].
        path: Corners, anticlockwise, y the height over the floor; a list between two holds a curve's control points.
        shift: Of the panel in its plane, before it is sewn [m].
        over: The height that it is folded down over, its wrong side outwards [m]; None: it stands upright.
    """
    path = [*path, path[0]]
    at = [k for k, one in enumerate(path) if isinstance(one, tuple)]
    edges = []
    for a, b in pairwise(at):
        inner = [point for one in path[a + 1 : b] if isinstance(one, list) for point in one]
        edges.append(Edge("bezier" if inner else "polyline", np.array([path[a], *inner, path[b]], dtype=float)))
    turn = SIDES[side]
    if over is None:
        return Panel(name, tuple(edges), placement=Placement(turn, turn @ [*shift, away]))
    place = turn @ [shift[0], 2.0 * over + shift[1], away]
    return Panel(name, tuple(edges), placement=Placement(turn @ np.diag([1.0, -1.0, -1.0]), place))


def mirrored(path: Sequence[Point | list[Point]]) -> list[Point | list[Point]]:
    """Return a path on the other side of the y axis, anticlockwise again; it begins with the same corner."""
    turned: list[Point | list[Point]] = [
        [(-x, y) for x, y in reversed(one)] if isinstance(one, list) else (-one[0], one[1]) for one in path
    ]
    return [turned[0], *reversed(turned[1:])]


def sewn(name: str, stature: float, panels: Sequence[Panel], seams: Sequence[Seam]) -> Pattern:
    """Return a pattern whose sides are all sewn right side to right side.

    Args:
        name: Of the garment.
        stature: Of the body it is cut for [m].
        panels: At that body's heights.
        seams: Edges of the first side in the order of its outline, and those of the second against it.
    """
    top = max(_heights(edge, one.placement).max() for one in panels if one.placement for edge in one.edges)
    rise = np.array([0.0, top * (_FILE_STATURE / stature - 1.0), 0.0])
    stitches = tuple(
        Stitch(tuple(Side(*one) for one in first), tuple(Side(*one, forward=False) for one in second))
        for first, second in seams
    )
    placed = []
    for one in panels:
        assert one.placement is not None
        place = Placement(one.placement.rotation, one.placement.translation + rise)
        placed.append(Panel(one.name, one.edges, grain=one.grain, placement=place))
    return Pattern(name, tuple(placed), stitches)


def _heights(edge: Edge, place: Placement) -> FloatArray:
    """Return the heights of an edge's points in space [m], shape (K,)."""
    return np.asarray(edge.points @ place.rotation[1, :2] + place.translation[1])
