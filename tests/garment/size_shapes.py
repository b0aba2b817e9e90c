"""Patterns of known measures for tests of sizes, and the parameters that foreign templates state, applied."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.io.patterns.garment_code import garment_code_pattern
from vto_pipeline.model.pattern import Edge, Notch, Panel, Pattern, Placement, Side, Stitch

FOREIGN = Path(__file__).parents[3] / "shared" / "data" / "patterns" / "garment_pattern_generator"
BACKWARDS = np.diag([-1.0, 1.0, -1.0])


def polygon(name: str, corners: list[tuple[float, float]], **more: Any) -> Panel:
    """A panel with straight edges; its y axis is the grain."""
    points = np.array(corners)
    edges = [Edge("polyline", np.stack([a, b])) for a, b in zip(points, np.roll(points, -1, axis=0), strict=True)]
    return Panel(name, tuple(edges), **more)


def placed(z: float) -> Placement:
    """In front of the body, or behind it with the right side out."""
    return Placement(np.eye(3) if z > 0 else BACKWARDS, np.array([0.0, 1.0, z]))


def sewn(*pairs: tuple[tuple[str, int], tuple[str, int]]) -> tuple[Stitch, ...]:
    """Edges that meet in opposite directions, as those of two right sides do."""
    return tuple(Stitch((Side(*a),), (Side(*b, forward=False),)) for a, b in pairs)


def tee(
    *,
    chest: float = 0.48,
    hem: float = 0.50,
    length: float = 0.70,
    shoulder: float = 0.13,
    neck: float = 0.09,
    armhole_depth: float = 0.24,
    sleeve: float = 0.21,
    cuff: float = 0.17,
) -> Pattern:
    """A T-shirt of straight lines with sleeves of one piece each; girths are half, `neck` is half of its width [m]."""
    tip = (neck + shoulder, length - 0.03)
    armpit = (chest / 2, length - armhole_depth)
    right = [(hem / 2, 0.0), armpit, tip, (neck, length)]
    slope = float(np.hypot(shoulder, 0.03))
    corners = [(-hem / 2, 0.0), *right, (0.0, length - 0.08), *[(-x, y) for x, y in right[:0:-1]]]
    grain = np.array([[0.0, 0.1], [0.0, 0.4]])
    notch = Notch(np.array([(hem + chest) / 4, armpit[1] / 2]), 0.0, 0.005)  # in the middle of a side seam
    panels = [
        polygon("front", corners, placement=placed(0.2), grain=grain, notches=(notch,)),
        polygon("back", corners, placement=placed(-0.2), grain=grain),
    ]
    seam = float(np.hypot(tip[0] - armpit[0], tip[1] - armpit[1]))
    crown = 0.1
    wide = float(np.sqrt(seam**2 - crown**2))
    pieces = [(-cuff, 0.0), (cuff, 0.0), (wide, sleeve - crown), (0.0, sleeve), (-wide, sleeve - crown)]
    panels += [polygon(f"{one}_sleeve", pieces) for one in ("left", "right")]
    # outline of front and back: 0 hem, 1 side, 2 armhole, 3 shoulder, 4 5 neck, 6 shoulder, 7 armhole, 8 side
    seams = [(("front", 1), ("back", 8)), (("front", 8), ("back", 1)), (("front", 3), ("back", 6))]
    seams += [(("front", 6), ("back", 3))]
    seams += [(("left_sleeve", 2), ("back", 7)), (("left_sleeve", 3), ("front", 2))]
    seams += [(("right_sleeve", 2), ("front", 7)), (("right_sleeve", 3), ("back", 2))]
    seams += [((f"{one}_sleeve", 1), (f"{one}_sleeve", 4)) for one in ("left", "right")]
    assert np.isclose(slope, np.hypot(tip[0] - neck, 0.03))
    return Pattern("tee", tuple(panels), sewn(*seams))


def skirt(*, waist: float = 0.36, hem: float = 0.52, length: float = 0.60) -> Pattern:
    """A straight-sided skirt of two panels, each with a dart of 2 by 10 cm in the middle; girths are half [m]."""
    w, h = waist / 2 + 0.01, hem / 2
    corners = [(-h, 0.0), (h, 0.0), (w, length), (0.01, length), (0.0, length - 0.1), (-0.01, length), (-w, length)]
    panels = tuple(polygon(name, corners, placement=placed(z)) for name, z in (("front", 0.2), ("back", -0.2)))
    seams = [(("front", 1), ("back", 6)), (("front", 6), ("back", 1))]
    seams += [((name, 3), (name, 4)) for name in ("front", "back")]
    return Pattern("skirt", panels, sewn(*seams))


def trousers(*, waist: float = 0.38, hem: float = 0.22, rise: float = 0.28, leg: float = 0.72) -> Pattern:
    """Trousers of straight lines, four panels, crotch 6 cm beyond the middle; `waist` and `hem` are half girths [m]."""
    panels = []
    for side, sign in (("L", -1.0), ("R", 1.0)):
        for name, z in (("front", 0.2), ("back", -0.2)):
            w, h = waist / 2, hem
            outer = [(0.0, rise + leg), (0.0, 0.0), (h, 0.0), (w + 0.06, leg), (w, rise + leg)]
            mirror = sign * (1.0 if z > 0 else -1.0)
            corners = outer if mirror > 0 else [(-x, y) for x, y in reversed(outer)]
            panels.append(polygon(f"{side}{name}", corners, placement=placed(z)))
    # of the one: 0 outseam, 1 hem, 2 inseam, 3 crotch, 4 waist; of its mirror image: 0 crotch, 1 inseam, 2 hem,
    # 3 outseam, 4 waist
    ahead = {"Rfront": (0, 2, 3), "Lback": (0, 2, 3), "Lfront": (3, 1, 0), "Rback": (3, 1, 0)}
    seams = [((f"{s}front", ahead[f"{s}front"][k]), (f"{s}back", ahead[f"{s}back"][k])) for s in "LR" for k in (0, 1)]
    seams += [((f"L{f}", ahead[f"L{f}"][2]), (f"R{f}", ahead[f"R{f}"][2])) for f in ("front", "back")]
    return Pattern("trousers", tuple(panels), sewn(*seams))


def foreign(template: dict[str, Any], name: str) -> Pattern:
    """The pattern of a document of others, read in this process."""
    return garment_code_pattern(template, name, name)[0]


def with_parameter(template: dict[str, Any], name: str, value: float) -> dict[str, Any]:
    """Apply a parameter of Garment-Pattern-Generator: edges become longer by a length, or by a factor."""
    data = copy.deepcopy(template)
    parameter = data["parameters"][name]
    for influence in parameter["influence"]:
        panel = data["pattern"]["panels"][influence["panel"]]
        points = np.array(panel["vertices"], dtype=float)
        for one in influence["edge_list"]:
            chain = one["id"] if isinstance(one["id"], list) else [one["id"]]
            ends = [panel["edges"][k]["endpoints"] for k in chain]
            numbers = list(dict.fromkeys(vertex for pair in ends for vertex in pair))
            first, last = ends[0][0], ends[-1][1]
            along = np.array(one["along"], float) if one.get("along") else points[last] - points[first]
            along /= np.linalg.norm(along)
            fixed = {"start": points[last], "end": points[first], "both": 0.5 * (points[first] + points[last])}
            reach = (points[numbers] - fixed[one["direction"]]) @ along
            if parameter["type"] == "length":
                moved = reach * value
            else:
                moved = reach + value * np.sign(reach) * (np.abs(reach) > 1e-9)
            points[numbers] += (moved - reach)[:, None] * along
        panel["vertices"] = points.tolist()
    return data
