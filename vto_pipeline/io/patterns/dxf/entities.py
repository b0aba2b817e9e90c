"""Entities of a DXF block as curves, points and texts, those of nested blocks among them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.dxf.layers import layer_of
from vto_pipeline.io.patterns.loops import Chain
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge

_DEPTH = 8  # of blocks within blocks; pieces have one at most
_CURVES = 8  # cubic curves an ellipse is made of at least: then they leave it by less than 1e-7 of its size
_FRAME = 16  # flag of a vertex that only steers a spline
_SAME = 1e-9  # of the unit: nearer points of a line are one


@dataclass
class Piece:
    """What a block holds, by layer.

    Args:
        chains: Layer -> curves, in the file's unit.
        points: Layer -> (place, angle [deg] or None, thickness).
        texts: Layer and text.
        skipped: Kinds of entities that are none of these.
    """

    chains: dict[int, list[Chain]] = field(default_factory=dict)
    points: dict[int, list[tuple[FloatArray, float | None, float]]] = field(default_factory=dict)
    texts: list[tuple[int, str]] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)


def piece_of(block: Any) -> Piece:
    """Return what a block of ezdxf holds.

    Raises:
        FormatError: blocks are nested too deeply, or in a circle; the block is named.
    """
    piece = Piece()
    for entity, layer in _entities(block, block.name, (block.name,)):
        name = f"{entity.dxftype()} #{entity.dxf.handle or '?'}"
        try:
            _add(piece, entity, layer, name)
        except (
            InputError,
            AttributeError,
            TypeError,
            ValueError,
            ZeroDivisionError,
        ) as e:
            problem = e.problem if isinstance(e, InputError) else f"{type(e).__name__}: {e}"[:100]
            raise FormatError(f"{name} is damaged: {problem}", where=f"block {block.name}") from None
    return piece


def _add(piece: Piece, entity: Any, layer: int, name: str) -> None:
    """Add an entity to what a block holds."""
    kind = entity.dxftype()
    if kind in ("TEXT", "ATTRIB", "MTEXT"):
        piece.texts.append((layer, entity.plain_text() if kind == "MTEXT" else entity.dxf.text))
    elif kind == "POINT":
        angle = entity.dxf.angle if entity.dxf.hasattr("angle") else None
        (where,) = _places(entity.dxf.location)
        piece.points.setdefault(layer, []).append((where, angle, abs(entity.dxf.get("thickness", 0.0))))
    else:
        chains = [Chain(name, tuple(edges)) for edges in _edges(entity) if edges]
        if not chains:
            piece.skipped.append(f"{name} on layer {entity.dxf.layer}")
        piece.chains.setdefault(layer, []).extend(chains)


def _entities(entities: Iterable[Any], block: str, inside: tuple[str, ...]) -> Iterator[tuple[Any, int]]:
    """Yield entities and their layers; what a nested block has on layer 0 lies on that of its insert."""
    for entity in entities:
        if entity.dxftype() != "INSERT":
            yield entity, layer_of(entity.dxf.layer)
            continue
        name = entity.dxf.name
        if name in inside or len(inside) > _DEPTH:
            problem = "contains itself" if name in inside else f"is nested deeper than {_DEPTH} blocks"
            raise FormatError(f"block {name} {problem}", where=f"block {inside[0]}")
        own = layer_of(entity.dxf.layer)
        yield from ((attribute, own) for attribute in entity.attribs)
        for inner, layer in _entities(entity.virtual_entities(), block, (*inside, name)):
            yield inner, own if layer == 0 else layer


def _edges(entity: Any) -> list[list[Edge]]:
    """Return the curves of an entity, each list end to end; none where it is no curve."""
    kind = entity.dxftype()
    flipped = entity.dxf.hasattr("extrusion") and entity.dxf.extrusion.z < 0.0
    if kind == "LINE":
        return [_polyline(_places(entity.dxf.start, entity.dxf.end), np.zeros(2))]
    if kind == "POLYLINE" and entity.is_2d_polyline and not flipped:
        rows = [(v.dxf.location.x, v.dxf.location.y, v.dxf.bulge) for v in entity.vertices if not v.dxf.flags & _FRAME]
        return [_polyline_of_rows(rows, entity.is_closed)]
    if kind == "LWPOLYLINE" and not flipped:
        return [_polyline_of_rows(list(entity.get_points("xyb")), entity.closed)]
    if kind == "ARC" and not flipped:
        turn = (entity.dxf.end_angle - entity.dxf.start_angle) % 360.0 or 360.0
        if turn < 359.0:
            ends = _places(entity.start_point, entity.end_point)
            return [_polyline(ends, np.array([np.tan(np.deg2rad(turn) / 4.0), 0.0]))]
    return _by_path(entity)


def _polyline_of_rows(rows: list[tuple[float, float, float]], closed: bool) -> list[Edge]:
    if len(rows) < 2:
        return []
    values = np.array(rows + rows[:1] * closed, dtype=np.float64)
    return _polyline(values[:, :2], values[:, 2])


def _polyline(points: FloatArray, bulges: FloatArray) -> list[Edge]:
    """Return straight runs as one edge each and bulges as arcs, from vertices (N, 2) and bulges (N,)."""
    keep = np.concatenate([np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME, [True]])
    points, bulges = points[keep], bulges[keep]
    edges: list[Edge] = []
    first = 0
    for k in range(len(points) - 1):
        if bulges[k] != 0.0:
            if k > first:
                edges.append(Edge("polyline", points[first : k + 1]))
            edges.append(Edge("arc", points[k : k + 2], float(bulges[k])))
            first = k + 1
    if len(points) - 1 > first:
        edges.append(Edge("polyline", points[first:]))
    return edges


def _by_path(entity: Any) -> list[list[Edge]]:
    """Return the curves of a spline, an ellipse, a circle or what else ezdxf makes a path of."""
    from ezdxf.path import Command, make_path

    try:
        path = make_path(entity, segments=_CURVES)
    except TypeError:
        return []
    found = []
    for part in path.sub_paths():
        edges: list[Edge] = []
        run = [part.start]
        step: Any
        for step in part.commands():
            if step.type == Command.LINE_TO:
                run.append(step.end)
                continue
            edges += _run(run)
            controls = [step.ctrl] if step.type == Command.CURVE3_TO else [step.ctrl1, step.ctrl2]
            corners = _places(run[-1], *controls, step.end)
            if np.ptp(corners, axis=0).max() > _SAME:
                edges.append(Edge("bezier", corners))
            run = [step.end]
        found.append(edges + _run(run))
    return found


def _run(run: list[Any]) -> list[Edge]:
    return _polyline(_places(*run), np.zeros(len(run))) if len(run) > 1 else []


def _places(*points: Any) -> FloatArray:
    return np.array([[point.x, point.y] for point in points], dtype=np.float64)
