"""T-shirt, shirt, dress and jacket: trunk, two-piece sleeves, and what is sewn to neck and cuffs.

Front pieces are drawn as one sees the wearer; the mirrored outline is the piece of the other side or of the back.
Names: front or back first, then the wearer's side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.bench.samples.patterns.pieces import Point, Seam, mirrored, piece, sewn
from vto_pipeline.bench.samples.patterns.tape import Tape
from vto_pipeline.model.pattern import Panel, Pattern
from vto_pipeline.numerics.plane_curves import curve_length

Path = list[Point | list[Point]]

_AWAY = 0.16  # m: of panels from the middle of the body
_SLOPE = np.deg2rad(20.0)  # of sleeves, downwards
_BESIDE = 0.06  # m: of sleeves from the trunk
_BAND, _CUFF = 0.035, 0.06  # m: heights of a collar's stand and of a cuff
_FALL, _POINT, _BEND = 0.045, 0.012, 9.0  # m: height of a collar's fall, how far its points go; its curvature [1/m]
_BUST_DART = (0.03, 0.10)  # m: how wide and how long


@dataclass(frozen=True)
class _Trunk:
    """Half of a trunk's width at its hem, under the arm, at the shoulder's and the neck's point, and their heights [m].

    Args:
        tape: Of the wearer.
        ease: More than the chest has.
        hem: Height of the hem, as a share of the stature.
        flare: By which half of the hem is wider than half of the chest.
    """

    tape: Tape
    ease: float
    hem: float
    flare: float = 0.0

    @property
    def under_arm(self) -> Point:
        return (self.tape.chest + self.ease) / 4.0, 0.70 * self.tape.stature

    @property
    def shoulder(self) -> Point:
        return 0.11 * self.tape.stature, 0.83 * self.tape.stature

    @property
    def neck(self) -> Point:
        return 0.046 * self.tape.stature, 0.86 * self.tape.stature

    @property
    def corner(self) -> Point:
        return self.under_arm[0] + self.flare, self.hem * self.tape.stature

    @property
    def armhole(self) -> list[Point]:
        return [(self.shoulder[0] - 0.01, self.under_arm[1] + 0.01)]

    def half(self, depth: float, dart: bool = False) -> Path:
        """Return the half at the viewer's right, from the middle of the hem; depth of its neck [m].

        Edges: hem, side (with a dart: below it, its two legs, above it), armhole, shoulder, neck, middle.
        """
        rise, long = _BUST_DART if dart else (0.0, 0.0)
        side: Path = []
        if dart:
            share = 0.85  # of the way up the side
            x, y = ((1 - share) * a + share * b for a, b in zip(self.corner, self.under_arm, strict=True))
            side = [(x, y), (x - long, y + 0.5 * rise), (x, y + rise)]

        def lifted(point: Point) -> Point:
            return point[0], point[1] + rise

        throat = (0.0, self.neck[1] - depth + rise)
        upper: Path = [lifted(self.under_arm), [lifted(p) for p in self.armhole], lifted(self.shoulder)]
        round_neck: Path = [lifted(self.neck), [(0.9 * self.neck[0], throat[1])], throat]
        return [(0.0, self.corner[1]), self.corner, *side, *upper, *round_neck]

    def sleeve(self, length: float, width: float) -> Path:
        """Return the front half of the sleeve at the viewer's right. Edges: underarm, cuff, top, armhole."""
        low, high = self.cuff(length, width)
        return [self.under_arm, low, high, self.shoulder, self.armhole]

    def cuff(self, length: float, width: float) -> tuple[Point, Point]:
        """Return the lower and upper end of a sleeve's cuff edge; length from above the underarm [m]."""
        x, y = self.shoulder
        length += (self.under_arm[0] - x) / np.cos(_SLOPE)
        far = np.array([x + length * np.cos(_SLOPE), y - length * np.sin(_SLOPE)])
        low = far - width * np.array([np.sin(_SLOPE), np.cos(_SLOPE)])
        return (float(low[0]), float(low[1])), (float(far[0]), float(far[1]))

    def cuff_band(self, length: float, width: float, band: float) -> Path:
        """Return the front half of a cuff beyond a sleeve. Edges: below, outer, above, inner."""
        low, high = map(np.array, self.cuff(length, width))
        along, up = np.array([np.cos(_SLOPE), -np.sin(_SLOPE)]), (high - low) / np.linalg.norm(high - low)
        start = 0.5 * (low + high) - 0.5 * band * up + 0.02 * along
        corners = [start, start + _CUFF * along, start + _CUFF * along + band * up, start + band * up]
        return [(float(x), float(y)) for x, y in corners]


def _whole(half: Path) -> Path:
    """Return both halves as one piece. Its edges: hem, half's, and half's backwards, the neck in two."""
    left = mirrored(half)
    return [left[-1], *half[1:], *left[2:-1]]


def _sleeves(trunk: _Trunk, length: float, width: float) -> tuple[list[Panel], list[Seam]]:
    """Return the four halves of two sleeves, and the seams along them; those to the trunk are its own."""
    path = trunk.sleeve(length, width)
    over = mirrored(path)  # its edges: armhole, top, cuff, underarm
    panels = [
        piece("front_sleeve_left", "front", _AWAY, path, (_BESIDE, 0.0)),
        piece("back_sleeve_left", "back", _AWAY, over, (-_BESIDE, 0.0)),
        piece("front_sleeve_right", "front", _AWAY, over, (-_BESIDE, 0.0)),
        piece("back_sleeve_right", "back", _AWAY, path, (_BESIDE, 0.0)),
    ]
    seams: list[Seam] = []
    for near, far in (("front_sleeve_left", "back_sleeve_left"), ("back_sleeve_right", "front_sleeve_right")):
        seams += [([(near, 2)], [(far, 1)]), ([(near, 0)], [(far, 3)])]
    return panels, seams


def tee(tape: Tape) -> Pattern:
    """Return a T-shirt."""
    trunk = _Trunk(tape, 0.12, 0.48)
    front, back = _whole(trunk.half(0.09)), _whole(trunk.half(0.03))
    panels = [piece("front", "front", _AWAY, front), piece("back", "back", _AWAY, back)]
    arms, seams = _sleeves(trunk, 0.12 * tape.stature, 0.105 * tape.stature)
    return sewn("tee", tape.stature, [*panels, *arms], [*_trunk_seams(), *_closed_armholes(), *seams])


def dress(tape: Tape) -> Pattern:
    """Return a sleeveless dress to the knee, with bust darts in its sides."""
    trunk = _Trunk(tape, 0.08, 0.30, 0.10)
    front = piece("front", "front", _AWAY, _whole(trunk.half(0.12, dart=True)))
    back = piece("back", "back", _AWAY, _whole(trunk.half(0.05)))
    seams: list[Seam] = [
        ([("front", 1), ("front", 4)], [("back", 8)]),
        ([("front", 11), ("front", 14)], [("back", 1)]),
        ([("front", 2)], [("front", 3)]),
        ([("front", 12)], [("front", 13)]),
        ([("front", 6)], [("back", 6)]),
        ([("front", 9)], [("back", 3)]),
    ]
    return sewn("dress", tape.stature, [front, back], seams)


def shirt(tape: Tape) -> Pattern:
    """Return a shirt, buttoned up, with long sleeves, cuffs that these are gathered into, and a collar."""
    trunk = _Trunk(tape, 0.14, 0.46)
    length, width, band = 0.22 * tape.stature, 0.08 * tape.stature, 0.065 * tape.stature
    panels, seams = _open_trunk(trunk, 0.06, 0.0)
    arms, more = _sleeves(trunk, length, width)
    seams += [*more, ([("front_left", 5)], [("front_right", 0)])]
    path = trunk.cuff_band(length, width, band)
    over = mirrored(path)
    for name, side, outline, shift in (
        ("front_left", "front", path, _BESIDE),
        ("back_left", "back", over, -_BESIDE),
        ("front_right", "front", over, -_BESIDE),
        ("back_right", "back", path, _BESIDE),
    ):
        where, which = name.split("_")
        panels.append(piece(f"{where}_cuff_{which}", side, _AWAY, outline, (shift, 0.0)))
        ends = (1, 3) if outline is path else (2, 0)
        seams.append(([(f"{where}_sleeve_{which}", ends[0])], [(f"{where}_cuff_{which}", ends[1])]))
    for near, far in (("front_cuff_left", "back_cuff_left"), ("back_cuff_right", "front_cuff_right")):
        seams += [([(near, 0)], [(far, 3)]), ([(near, 2)], [(far, 1)])]
    collar, ring = _stand(trunk, panels)
    fall, turned = _fall(trunk, panels)
    return sewn("shirt", tape.stature, [*panels, *arms, *collar, *fall], [*seams, *ring, *turned])


def jacket(tape: Tape) -> Pattern:
    """Return a jacket with an open front, long sleeves and a hood."""
    trunk = _Trunk(tape, 0.20, 0.47)
    panels, seams = _open_trunk(trunk, 0.07, 0.02)
    arms, more = _sleeves(trunk, 0.24 * tape.stature, 0.09 * tape.stature)
    front, back = _length(panels[0], 4), _length(panels[2], 4)
    low, high = trunk.neck[1], trunk.neck[1] + 0.2 * tape.stature
    curve = [(back + 0.10, low + 0.14), (back + 0.02, high)]
    hood: Path = [(-front, low), (0.0, low), (back, low), curve, (-front, high)]  # neck, neck, back and top, front
    hoods = [piece("hood_left", "left", 0.09, hood), piece("hood_right", "right", 0.09, mirrored(hood))]
    seams += [
        ([("front_left", 4)], [("hood_left", 0)]),
        ([("back", 5)], [("hood_left", 1)]),
        ([("back", 4)], [("hood_right", 2)]),
        ([("front_right", 1)], [("hood_right", 3)]),
        ([("hood_left", 2)], [("hood_right", 1)]),
    ]
    return sewn("jacket", tape.stature, [*panels, *arms, *hoods], [*seams, *more])


def _open_trunk(trunk: _Trunk, depth: float, apart: float) -> tuple[list[Panel], list[Seam]]:
    """Return left and right front, the back, and their seams to each other and to the sleeves."""
    half = trunk.half(depth)
    panels = [
        piece("front_left", "front", _AWAY, half, (apart, 0.0)),
        piece("front_right", "front", _AWAY, mirrored(half), (-apart, 0.0)),
        piece("back", "back", _AWAY, _whole(trunk.half(0.02))),
    ]
    seams: list[Seam] = [
        ([("front_left", 1)], [("back", 8)]),
        ([("front_right", 4)], [("back", 1)]),
        ([("front_left", 3)], [("back", 6)]),
        ([("front_right", 2)], [("back", 3)]),
        ([("front_left", 2)], [("front_sleeve_left", 3)]),
        ([("front_right", 3)], [("front_sleeve_right", 0)]),
        ([("back", 7)], [("back_sleeve_left", 0)]),
        ([("back", 2)], [("back_sleeve_right", 3)]),
    ]
    return panels, seams


def _trunk_seams() -> list[Seam]:
    """Return sides and shoulders of two whole pieces."""
    return [([("front", a)], [("back", b)]) for a, b in ((1, 8), (8, 1), (3, 6), (6, 3))]


def _closed_armholes() -> list[Seam]:
    """Return the armholes of two whole pieces."""
    return [
        ([("front", 2)], [("front_sleeve_left", 3)]),
        ([("front", 7)], [("front_sleeve_right", 0)]),
        ([("back", 7)], [("back_sleeve_left", 0)]),
        ([("back", 2)], [("back_sleeve_right", 3)]),
    ]


def _stand(trunk: _Trunk, panels: list[Panel]) -> tuple[list[Panel], list[Seam]]:
    """Return the three pieces of a collar's stand, open in front, and their seams."""
    front, back = _length(panels[0], 4), _length(panels[2], 4)
    low = trunk.neck[1]
    side: Path = [(0.0, low), (front, low), (front, low + _BAND), (0.0, low + _BAND)]
    whole: Path = [(-back, low), (0.0, low), (back, low), (back, low + _BAND), (-back, low + _BAND)]
    pieces = [
        piece("front_collar_left", "front", 0.09, side, (0.01, 0.0)),
        piece("front_collar_right", "front", 0.09, mirrored(side), (-0.01, 0.0)),
        piece("back_collar", "back", 0.09, whole),
    ]
    seams: list[Seam] = [
        ([("front_left", 4)], [("front_collar_left", 0)]),
        ([("front_right", 1)], [("front_collar_right", 3)]),
        ([("back", 4), ("back", 5)], [("back_collar", 1), ("back_collar", 0)]),
        ([("front_collar_left", 1)], [("back_collar", 4)]),
        ([("front_collar_right", 2)], [("back_collar", 2)]),
    ]
    return pieces, seams


def _fall(trunk: _Trunk, panels: list[Panel]) -> tuple[list[Panel], list[Seam]]:
    """Return the three pieces of a collar's fall, folded down over its stand, and their seams."""
    front, back = _length(panels[0], 4), _length(panels[2], 4)
    low = trunk.neck[1] + _BAND
    side, whole = _bent(front, 0.5 * front, low, _POINT), _bent(2.0 * back, 0.0, low, 0.0)
    pieces = [
        piece("front_fall_left", "front", 0.13, side, (0.01, 0.0), over=low),
        piece("front_fall_right", "front", 0.13, mirrored(side), (-0.01, 0.0), over=low),
        piece("back_fall", "back", 0.13, whole, over=low),
    ]
    seams: list[Seam] = [
        ([("front_collar_left", 2)], [("front_fall_left", 0)]),
        ([("front_collar_right", 1)], [("front_fall_right", 3)]),
        ([("back_collar", 3)], [("back_fall", 0)]),
        ([("front_fall_left", 1)], [("back_fall", 3)]),
        ([("front_fall_right", 2)], [("back_fall", 1)]),
    ]
    return pieces, seams


def _bent(length: float, middle: float, low: float, point: float) -> Path:
    """Return a strip whose lower edge is a shallow arc, so that its upper one is longer and lies outside when folded.

    Args:
        length: Of the lower edge [m].
        middle, low: Where the middle of its lower edge is [m].
        point: How much farther its left end goes up [m].
    """
    half, radius = 0.5 * length * _BEND, 1.0 / _BEND

    def at(share: float, far: float) -> Point:
        return middle + far * float(np.sin(share * half)), low - radius + far * float(np.cos(share * half))

    inner, outer, reach = radius, radius + _FALL, 1.0 / float(np.cos(half))  # of the control point of a curve
    return [
        at(-1, inner),
        [at(0, inner * reach)],
        at(1, inner),
        at(1, outer),
        [at(0, outer * reach)],
        at(-1, outer + point),
    ]


def _length(panel: Panel, edge: int) -> float:
    one = panel.edges[edge]
    return curve_length(one.kind, one.points, one.bulge)
