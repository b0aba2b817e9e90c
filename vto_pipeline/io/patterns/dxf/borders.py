"""Where one edge of an outline ends and the next begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.io.patterns.loops import JOIN_M
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge

_CORNER = np.deg2rad(30.0)  # a polyline that turns by more has a corner; curves are drawn in steps of a few degrees


def split_at_borders(loop: Sequence[Edge], turn_points: FloatArray) -> tuple[Edge, ...]:
    """Return a closed outline with its polylines split and joined so that they end at borders.

    Args:
        loop: End to end.
        turn_points: Where edges end [m], shape (N, 2). None on the outline: at its corners, and where lines of the file
            end.

    Returns:
        The outline, from a border on. Arcs and Bezier curves stay as they are.
    """
    edges = [piece for edge in loop for piece in _at_vertices(edge, turn_points)]
    marked = [_near(edge.points[0], turn_points) for edge in edges]
    if sum(marked) < 2:
        edges = [piece for edge in loop for piece in _at_corners(edge)]
        marked = [True] * len(edges)
    border = [
        mark or edge.kind != "polyline" or edges[k - 1].kind != "polyline"
        for k, (edge, mark) in enumerate(zip(edges, marked, strict=True))
    ]
    first = border.index(True)
    joined: list[Edge] = []
    for k in range(first, first + len(edges)):
        edge = edges[k % len(edges)]
        if border[k % len(edges)]:
            joined.append(edge)
        else:
            joined[-1] = replace(joined[-1], points=np.concatenate([joined[-1].points, edge.points[1:]]))
    return tuple(joined)


def _at_vertices(edge: Edge, places: FloatArray) -> list[Edge]:
    """Return a polyline split at its vertices that lie at places (N, 2)."""
    if edge.kind != "polyline":
        return [edge]
    return _split(edge, np.array([_near(point, places) for point in edge.points[1:-1]], dtype=np.bool_))


def _at_corners(edge: Edge) -> list[Edge]:
    """Return a polyline split where it turns sharply."""
    if edge.kind != "polyline":
        return [edge]
    way = np.diff(edge.points, axis=0)
    turn = np.arctan2(way[:-1, 0] * way[1:, 1] - way[:-1, 1] * way[1:, 0], (way[:-1] * way[1:]).sum(axis=1))
    return _split(edge, np.abs(turn) > _CORNER)


def _split(edge: Edge, inner: NDArray[np.bool_]) -> list[Edge]:
    """Return a polyline split at those of its inner vertices."""
    ends = [0, *(np.flatnonzero(inner) + 1).tolist(), len(edge.points) - 1]
    return [replace(edge, points=edge.points[low : high + 1]) for low, high in pairwise(ends)]


def _near(point: FloatArray, places: FloatArray) -> bool:
    return bool(len(places) and np.linalg.norm(places - point, axis=1).min() <= JOIN_M)
