"""Skirt and trousers, each held by a waistband that it is gathered into a little."""

from __future__ import annotations

from vto_pipeline.bench.samples.patterns.pieces import Point, Seam, mirrored, piece, sewn
from vto_pipeline.bench.samples.patterns.tape import Tape
from vto_pipeline.model.pattern import Panel, Pattern

_AWAY = 0.15  # m: of panels from the middle of the body
_BAND = 0.04  # m
_GATHERED = 1.06  # times the waistband
_WAIST, _HIP, _CROTCH, _KNEE, _ANKLE = 0.615, 0.52, 0.46, 0.30, 0.07  # heights, as shares of the stature
_FORK = {"front": 0.045, "back": 0.095}  # m: by which trousers reach beyond the middle, between the legs


def skirt(tape: Tape) -> Pattern:
    """Return a skirt to the knee."""
    top, hem = _WAIST * tape.stature, _KNEE * tape.stature
    waist = _GATHERED * tape.waist / 4.0
    wide = max(waist, (tape.hip + 0.08) / 4.0) + 0.08
    path: list[Point | list[Point]] = [(-wide, hem), (wide, hem), (waist, top), (0.0, top), (-waist, top)]
    panels = [piece("front", "front", _AWAY, path), piece("back", "back", _AWAY, path)]
    seams: list[Seam] = [([("front", 1)], [("back", 4)]), ([("front", 4)], [("back", 1)])]
    for side in ("front", "back"):
        seams += [([(side, 2)], [(f"{side}_band", 1)]), ([(side, 3)], [(f"{side}_band", 0)])]
    bands, more = _waistband(tape)
    return sewn("skirt", tape.stature, [*panels, *bands], [*seams, *more])


def trousers(tape: Tape) -> Pattern:
    """Return straight trousers to the ankle."""
    front, back = _leg(tape, "front"), _leg(tape, "back")
    apart = _FORK["back"] + 0.02
    panels = [
        piece("front_left", "front", _AWAY, front, (apart, 0.0)),
        piece("front_right", "front", _AWAY, mirrored(front), (-apart, 0.0)),
        piece("back_left", "back", _AWAY, mirrored(back), (-apart, 0.0)),
        piece("back_right", "back", _AWAY, back, (apart, 0.0)),
    ]
    seams: list[Seam] = []
    for near, far in (("front_left", "back_left"), ("back_right", "front_right")):
        seams += [([(near, 1), (near, 2)], [(far, 4), (far, 3)]), ([(near, 5)], [(far, 0)])]
    seams += [([("front_left", 4)], [("front_right", 1)]), ([("back_right", 4)], [("back_left", 1)])]
    for one, edge, band, half in (
        ("front_left", 3, "front_band", 1),
        ("front_right", 2, "front_band", 0),
        ("back_left", 2, "back_band", 0),
        ("back_right", 3, "back_band", 1),
    ):
        seams.append(([(one, edge)], [(band, half)]))
    bands, more = _waistband(tape)
    return sewn("trousers", tape.stature, [*panels, *bands], [*seams, *more])


def _leg(tape: Tape, side: str) -> list[Point | list[Point]]:
    """Return the piece at the viewer's right. Edges: hem, outseam to the hip, above it, waist, crotch, inseam."""
    waist, hip, fork = _GATHERED * tape.waist / 4.0, (tape.hip + 0.06) / 4.0, _FORK[side]
    hip = max(hip, waist)
    middle = 0.5 * (hip - fork)
    half = 0.07 * tape.hip + 0.5 * (fork - _FORK["front"]) + 0.02  # so that in- and outseams are alike
    top, low, hem = _WAIST * tape.stature, _CROTCH * tape.stature - 0.02, _ANKLE * tape.stature
    crotch = [(0.0, low + 0.06), (-0.3 * fork, low)]
    seat = _HIP * tape.stature
    return [(middle - half, hem), (middle + half, hem), (hip, seat), (waist, top), (0.0, top), crotch, (-fork, low)]


def _waistband(tape: Tape) -> tuple[list[Panel], list[Seam]]:
    """Return both halves of a waistband, whose lower edge has two parts, and the seams between them."""
    low, half = _WAIST * tape.stature + 0.01, tape.waist / 4.0
    path: list[Point | list[Point]] = [(-half, low), (0.0, low), (half, low), (half, low + _BAND), (-half, low + _BAND)]
    panels = [piece("front_band", "front", _AWAY, path), piece("back_band", "back", _AWAY, path)]
    return panels, [([("front_band", a)], [("back_band", b)]) for a, b in ((2, 4), (4, 2))]
