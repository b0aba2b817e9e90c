"""Patterns as JSON of our own: `panels.json`, in metres; also how the readers' child process answers."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays
from vto_pipeline.io.patterns.loops import edges_area
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import (
    CurveKind,
    Edge,
    InnerLine,
    Notch,
    Panel,
    Pattern,
    Placement,
    Side,
    Stitch,
)

Point = tuple[float, float]
Vector = tuple[float, float, float]


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class _EdgeRecord(_Record):
    kind: CurveKind
    points: list[Point]
    bulge: float = 0.0
    label: str = ""


class _NotchRecord(_Record):
    position: Point
    angle: float | None = None
    depth: float = 0.0
    kind: str = "slit"


class _LineRecord(_Record):
    kind: str
    curves: list[_EdgeRecord]


class _PlacementRecord(_Record):
    rotation: tuple[Vector, Vector, Vector]
    translation: Vector
    worn_at: list[tuple[float, float, float, float, float]] | None = None


class _PanelRecord(_Record):
    name: str
    edges: list[_EdgeRecord]
    size: str = ""
    grain: tuple[Point, Point] | None = None
    notches: list[_NotchRecord] = []
    lines: list[_LineRecord] = []
    drills: list[Point] = []
    cut: list[_EdgeRecord] = []
    placement: _PlacementRecord | None = None
    notes: list[str] = []


class _SideRecord(_Record):
    panel: str
    edge: int
    forward: bool = True


class _StitchRecord(_Record):
    first: list[_SideRecord]
    second: list[_SideRecord]


class _PatternRecord(_Record):
    schema_: Literal[1] = Field(alias="schema")
    unit: Literal["m"]
    name: str
    source_unit: str = "m"
    worn: bool = False
    panels: list[_PanelRecord]
    stitches: list[_StitchRecord] = []


def is_own(data: Any) -> bool:
    """Return whether a JSON document claims to be a pattern of ours."""
    return isinstance(data, dict) and "schema" in data and "panels" in data


def record_of(pattern: Pattern) -> dict[str, Any]:
    """Return a pattern as plain JSON values, lengths in metres."""
    return {
        "schema": 1,
        "unit": "m",
        "name": pattern.name,
        "source_unit": pattern.unit,
        "worn": pattern.worn,
        "panels": [_panel_record(panel) for panel in pattern.panels],
        "stitches": [{"first": _sides(s.first), "second": _sides(s.second)} for s in pattern.stitches],
    }


def pattern_of(data: Any, where: str) -> Pattern:
    """Return the pattern that plain JSON values hold.

    Args:
        data: As `record_of` returns them.
        where: The file, for messages.

    Raises:
        FormatError: a key is unknown or missing, a value is of the wrong type, or an outline is not closed.
    """
    try:
        record = _PatternRecord.model_validate(data)
    except ValidationError as e:
        fault = e.errors(include_url=False, include_context=False)[0]
        key = ".".join(str(k) for k in fault["loc"]) or "document"
        raise FormatError(f"{key}: {fault['msg'][:1].lower()}{fault['msg'][1:]}", where=where) from None
    try:
        panels = tuple(_panel(one) for one in record.panels)
        for panel in panels:
            if not edges_area(panel.edges) > 0.0:
                raise InputError(f"the outline of panel {panel.name!r} runs clockwise, or encloses nothing")
        stitches = tuple(
            Stitch(*(tuple(Side(s.panel, s.edge, s.forward) for s in chain) for chain in (one.first, one.second)))
            for one in record.stitches
        )
        return Pattern(record.name, panels, stitches, record.source_unit, record.worn)
    except InputError as e:
        raise FormatError(e.problem, where=where, hint=e.hint) from None


def answer(pattern: Pattern, notes: Sequence[str]) -> Arrays:
    """Return a pattern and notes as the arrays that a reader's child process answers with."""
    return {"pattern": np.array(json.dumps(record_of(pattern))), "notes": np.array(list(notes), dtype=np.str_)}


def _edge_records(edges: tuple[Edge, ...]) -> list[dict[str, Any]]:
    return [{"kind": e.kind, "points": e.points.tolist(), "bulge": e.bulge, "label": e.label} for e in edges]


def _panel_record(panel: Panel) -> dict[str, Any]:
    placement = panel.placement
    return {
        "name": panel.name,
        "size": panel.size,
        "edges": _edge_records(panel.edges),
        "cut": _edge_records(panel.cut),
        "grain": _list(panel.grain),
        "notches": [
            {"position": n.position.tolist(), "angle": n.angle, "depth": n.depth, "kind": n.kind} for n in panel.notches
        ],
        "lines": [{"kind": line.kind, "curves": _edge_records(line.curves)} for line in panel.lines],
        "drills": _list(panel.drills) or [],
        "placement": None
        if placement is None
        else {
            "rotation": placement.rotation.tolist(),
            "translation": placement.translation.tolist(),
            "worn_at": _list(placement.worn_at),
        },
        "notes": list(panel.notes),
    }


def _sides(chain: tuple[Side, ...]) -> list[dict[str, Any]]:
    return [{"panel": side.panel, "edge": side.edge, "forward": side.forward} for side in chain]


def _list(array: FloatArray | None) -> Any:
    return None if array is None else array.tolist()


def _edges(records: list[_EdgeRecord]) -> tuple[Edge, ...]:
    return tuple(Edge(one.kind, np.asarray(one.points), one.bulge, one.label) for one in records)


def _panel(record: _PanelRecord) -> Panel:
    placed = record.placement
    return Panel(
        record.name,
        _edges(record.edges),
        record.size,
        None if record.grain is None else np.asarray(record.grain),
        tuple(Notch(np.asarray(n.position), n.angle, n.depth, n.kind) for n in record.notches),
        tuple(InnerLine(line.kind, _edges(line.curves)) for line in record.lines),
        np.asarray(record.drills) if record.drills else None,
        _edges(record.cut),
        None if placed is None else _placement(placed),
        tuple(record.notes),
    )


def _placement(record: _PlacementRecord) -> Placement:
    worn_at = None if record.worn_at is None else np.asarray(record.worn_at).reshape(-1, 5)
    return Placement(np.asarray(record.rotation), np.asarray(record.translation), worn_at)
