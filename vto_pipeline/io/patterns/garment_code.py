"""Patterns of GarmentCode, and of its predecessor Garment-Pattern-Generator: JSON, specifications and templates.

Panels have vertices in the plane and edges between them; a curved edge has its control points relative to its chord
(Korosteleva & Lee 2021; Korosteleva & Sorkine-Hornung 2023). Units are given per metre, centimetres where they are not.
Angles are Euler angles about the axes x, then y, then z of space [deg].
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.patterns.loops import edges_area
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.pattern import Edge, Panel, Pattern, Placement, Side, Stitch

_RIGHT_WRONG = "right_wrong"  # a stitch of the right side of one panel to the wrong side of the other
_FLIP = np.array([-1.0, 1.0, -1.0])  # half a turn about y, which shows the other side of a panel
_KNOWN_PANEL = {"translation", "rotation", "vertices", "edges", "label"}


def is_garment_code(data: Any) -> bool:
    """Return whether a JSON document is one of GarmentCode's."""
    return isinstance(data, dict) and isinstance(data.get("pattern"), dict) and "panels" in data["pattern"]


def garment_code_pattern(data: Any, name: str, where: str) -> tuple[Pattern, list[str]]:
    """Return the pattern of a document, and what in it was not taken.

    Args:
        data: Plain JSON values.
        name: Of the garment.
        where: The file, for messages.

    Raises:
        FormatError: a panel, an edge or a stitch is not as the format has it; it is named.
    """
    properties = data.get("properties") or {}
    per_metre = properties.get("units_in_meter", 100)
    if not isinstance(per_metre, int | float) or not 0 < per_metre < 1e6:
        raise FormatError(f"properties.units_in_meter is {per_metre!r}; expected a positive number", where=where)
    relative = properties.get("curvature_coords", "relative") == "relative"
    notes: list[str] = []
    panels = []
    for key, raw in _mapping(data["pattern"]["panels"], "pattern.panels", where).items():
        at = f"{where}, panel {key}"
        try:
            panels.append(_panel(key, _mapping(raw, "the panel", at), 1.0 / per_metre, relative, at))
        except InputError as e:
            raise FormatError(e.problem, where=e.where or at, hint=e.hint) from None
        unknown = sorted(set(raw) - _KNOWN_PANEL)
        if unknown:
            notes.append(f"panel {key}: not taken: {', '.join(unknown)}")
    if data.get("parameters"):
        notes.append(f"a template of {len(data['parameters'])} parameters, taken at the values it was saved with")
    stitches = tuple(
        _stitch(raw, f"{where}, stitch {number}") for number, raw in enumerate(data["pattern"].get("stitches") or ())
    )
    unit = f"{per_metre:g} units a metre" + ("" if "units_in_meter" in properties else ", assumed")
    try:
        return Pattern(name, tuple(panels), stitches, unit), notes
    except InputError as e:
        raise FormatError(e.problem, where=where, hint=e.hint) from None


def _panel(name: str, raw: dict[str, Any], scale: float, relative: bool, where: str) -> Panel:
    corners = _numbers(raw.get("vertices"), 2, "vertices", where)
    edges = []
    for number, one in enumerate(raw.get("edges") or ()):
        edges.append(_edge(_mapping(one, f"edge {number}", where), corners, relative, f"{where}, edge {number}"))
    outline = tuple(Edge(e.kind, scale * e.points, e.bulge, e.label) for e in edges)
    placement = None
    if "translation" in raw or "rotation" in raw:
        angles = _numbers([raw.get("rotation", [0, 0, 0])], 3, "rotation", where)[0]
        shift = _numbers([raw.get("translation", [0, 0, 0])], 3, "translation", where)[0]
        placement = Placement(_rotation(np.deg2rad(angles)), scale * shift)
    if edges_area(outline) < 0.0:  # the file shows its wrong side
        outline = tuple(Edge(e.kind, _FLIP[:2] * e.points, -e.bulge, e.label) for e in outline)
        placement = placement and Placement(placement.rotation * _FLIP, placement.translation)
    label = raw.get("label")
    return Panel(name, outline, placement=placement, notes=(f"label: {label}",) if label else ())


def _edge(raw: dict[str, Any], corners: FloatArray, relative: bool, where: str) -> Edge:
    ends = raw.get("endpoints")
    if not isinstance(ends, list) or len(ends) != 2 or not all(_is_index(end, len(corners)) for end in ends):
        raise FormatError(f"endpoints are {ends!r}; expected two of the {len(corners)} vertices", where=where)
    start, end = corners[ends[0]], corners[ends[1]]
    label = str(raw.get("label", ""))
    curvature = raw.get("curvature")
    if curvature is None:
        return Edge("polyline", np.stack([start, end]), label=label)
    if isinstance(curvature, list):
        curvature = {"type": "quadratic", "params": [curvature]}
    curve = _mapping(curvature, "curvature", where)
    kind, params = curve.get("type"), curve.get("params")
    if kind == "circle":
        return Edge("arc", np.stack([start, end]), _bulge(params, float(np.linalg.norm(end - start)), where), label)
    if kind not in ("quadratic", "cubic"):
        raise FormatError(f"curvature of type {kind!r}; expected quadratic, cubic or circle", where=where)
    controls = _numbers(params, 2, "curvature", where)
    if len(controls) != (1 if kind == "quadratic" else 2):
        raise FormatError(f"a {kind} curve with {len(controls)} control points", where=where)
    if relative:
        chord = end - start
        controls = start + controls[:, :1] * chord + controls[:, 1:] * np.array([-chord[1], chord[0]])
    return Edge("bezier", np.concatenate([start[None], controls, end[None]]), label=label)


def _bulge(params: Any, chord: float, where: str) -> float:
    """Return the bulge of an arc given as in SVG: radius, whether it is the larger part, whether it turns right.

    Turning right in SVG, where y points down, is anticlockwise where y points up.
    """
    if not isinstance(params, list) or len(params) != 3 or not all(isinstance(p, int | float) for p in params):
        raise FormatError(f"a circle of {params!r}; expected radius, large arc, right", where=where)
    radius, large, right = params
    if not radius > 0.0 or chord == 0.0:
        raise FormatError(f"a circle of radius {radius} over a chord of {chord:.4g}", where=where)
    half = np.arcsin(min(chord / (2.0 * radius), 1.0))  # a radius too small is taken for the least, as SVG does
    angle = 2.0 * (np.pi - half if large else half)
    return float(np.tan(angle / 4.0)) * (1.0 if right else -1.0)


def _stitch(raw: Any, where: str) -> Stitch:
    """Outlines run round the right side of each panel, so two edges meet in opposite directions."""
    sides, extra = (raw[:2], raw[2:]) if isinstance(raw, list) else (raw, ())
    if not isinstance(sides, list) or len(sides) != 2 or any(word != _RIGHT_WRONG for word in extra):
        raise FormatError(f"expected two sides, found {str(raw)[:80]}", where=where)
    found = []
    for side in sides:
        one = _mapping(side, "a side", where)
        if not isinstance(one.get("panel"), str) or not isinstance(one.get("edge"), int):
            raise FormatError(f"a side is {one!r}; expected panel and edge", where=where)
        found.append((one["panel"], one["edge"]))
    return Stitch((Side(*found[0]),), (Side(*found[1], forward=bool(extra)),))


def _rotation(angles: FloatArray) -> FloatArray:
    """Return the rotation about x, then y, then z of space [rad]."""
    (a, b, c), (x, y, z) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, a, -x], [0, x, a]])
    about_y = np.array([[b, 0, y], [0, 1, 0], [-y, 0, b]])
    about_z = np.array([[c, -z, 0], [z, c, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def _is_index(value: Any, count: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < count


def _mapping(value: Any, what: str, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise FormatError(f"{what} is {str(value)[:40]!r}; expected keys and values", where=where)
    return value


def _numbers(values: Any, width: int, what: str, where: str) -> FloatArray:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1] != width or not np.isfinite(array).all():
        raise FormatError(f"{what}: expected rows of {width} finite numbers, found {str(values)[:60]}", where=where)
    return array
