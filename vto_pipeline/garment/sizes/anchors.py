"""Where the anchors of a panel move from one size to the next: armpit, shoulder, hem and so on.

A girth is shared among the panels in proportion to their widths, and on each panel between its two sides; the middle of
a front or back stays. Along the grain the neck end of the shoulder stays, or the upper edge of legs and skirts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vto_pipeline.errors import GarmentError
from vto_pipeline.garment.sizes.flat import FlatMeasure
from vto_pipeline.garment.sizes.outline import Outline
from vto_pipeline.garment.sizes.steps import Steps
from vto_pipeline.garment.sizes.widths import armpit_level, crotch_level, edge_lengths, width_at

Moves = dict[int, tuple[float, float]]
"""Corner -> move across and up [m]."""


def anchor_moves(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    """Return the moves of the anchors of a panel.

    Args:
        one: The panel.
        flat: Flat measurements of the whole garment, which its share of a girth is taken of.
        steps: From the base to the size.

    Raises:
        GarmentError: the panel lacks an anchor that its part of a garment needs.
    """
    return _MOVERS[one.part](one, flat, steps)


def _grown(one: Outline, role: str, flat: Mapping[str, FlatMeasure], steps: Steps) -> float:
    """Return by how much an edge of the panel becomes longer: its share of a girth [m]."""
    return steps.girth(role) * edge_lengths([one], role) / (2.0 * flat[role].value) if role in flat else 0.0


def _torso(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    armpits = one.corners_between("armhole", "side")
    level = armpit_level(one)
    if level is None or len(armpits) > 2:
        problem = f"panel {one.panel.name!r}: {len(armpits)} corners between armhole and side; expected 1 or 2"
        raise GarmentError(problem, hint="yokes and side panels cannot be graded yet")
    across = one.corners[:, 0]
    if len(armpits) == 2:
        middle = float(across[armpits].mean())
    else:
        ends = (float(across.min()), float(across.max()))
        middle = max(ends, key=lambda end: abs(end - across[armpits[0]]))
    sides = len(armpits)
    sign = np.where(across > middle, 1.0, -1.0)
    chest = steps.girth("chest") * width_at(one.points(), level) / (2.0 * flat["chest"].value) / sides
    neck = steps.girth("neck") / (2.0 * np.pi)  # the radius of a circle of that girth
    moves: Moves = {k: (sign[k] * chest, -steps.length("armhole_depth")) for k in armpits}
    for k in one.corners_between("shoulder", "neck"):
        moves[k] = (sign[k] * neck, 0.0)
    for k in one.corners_between("shoulder", "armhole"):
        edge = k - 1 if one.roles[k - 1] == "shoulder" else k
        start, end = one.corners[edge], one.corners[(edge + 1) % len(one.corners)]
        along = np.abs(end - start) / np.linalg.norm(end - start)
        longer = steps.length("shoulder") * along
        moves[k] = (sign[k] * (neck + longer[0]), -longer[1])
    for pair in (("neck", "neck"), ("neck", "front"), ("neck", "middle")):
        moves |= dict.fromkeys(one.corners_between(*pair), (0.0, -neck))
    for role, drop in (("hem", "length"), ("waist", "bodice")):
        wider = _grown(one, role, flat, steps) / sides
        for k in one.corners_between("side", role):
            moves[k] = (sign[k] * wider, -steps.length(drop))
        for border in ("front", "middle"):
            moves |= dict.fromkeys(one.corners_between(border, role), (0.0, -steps.length(drop)))
    return moves


def _sleeve(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    wider = 0.5 * _grown(one, "cuff", flat, steps)
    ends = one.corners_between("cuff", "seam")
    middle = one.corners[ends, 0].mean() if ends else 0.0
    moves: Moves = dict.fromkeys([*one.corners_between("cap", "seam"), *one.corners_between("cap", "cap")], (0.0, 0.0))
    for k in ends:
        moves[k] = (wider if one.corners[k, 0] > middle else -wider, -steps.length("sleeve"))
    return moves


def _leg(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    """Waist and hem grow on both sides alike; at the crotch the seam inside takes what the one outside does not."""
    outer, inner = (one.corners[one.edges_of(role), 0].mean() for role in ("outseam", "inseam"))
    out = 1.0 if outer > inner else -1.0
    waist, hem = 0.5 * _grown(one, "waist", flat, steps), 0.5 * _grown(one, "hem", flat, steps)
    level = crotch_level(one)
    top, low = one.corners[:, 1].max(), one.corners[:, 1].min()
    outside = waist + (hem - waist) * (top - level) / (top - low)
    thigh = steps.girth("thigh") * width_at(one.points(), level) / (2.0 * flat["thigh"].value)
    drop = steps.length("rise") + steps.length("inseam")
    moves: Moves = dict.fromkeys(one.corners_between("waist", "outseam"), (out * waist, 0.0))
    moves |= dict.fromkeys(one.corners_between("waist", "crotch"), (-out * waist, 0.0))
    moves |= dict.fromkeys(one.corners_between("crotch", "inseam"), (-out * (thigh - outside), -steps.length("rise")))
    moves |= dict.fromkeys(one.corners_between("hem", "outseam"), (out * hem, -drop))
    return moves | dict.fromkeys(one.corners_between("hem", "inseam"), (-out * hem, -drop))


def _skirt(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    waist = 0.5 * _grown(one, "waist", flat, steps)
    hem = 0.5 * _grown(one, "hem", flat, steps) if "hem" in steps.girths else waist
    middle = one.corners[:, 0].mean()
    moves: Moves = {}
    for role, wider, drop in (("waist", waist, 0.0), ("hem", hem, steps.length("length"))):
        for k in one.corners_between(role, "side"):
            moves[k] = (wider if one.corners[k, 0] > middle else -wider, -drop)
    if len(moves) != 4:
        problem = f"panel {one.panel.name!r}: {len(moves)} corners between its sides and waist or hem; expected 4"
        raise GarmentError(problem, hint="skirts are graded whose panels run from waist to hem")
    return moves


def _waistband(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    wider = 0.5 * _grown(one, "waist", flat, steps)
    middle = one.corners[:, 0].mean()
    ends = [k for role in ("waist", "lower") for k in one.corners_between("end", role)]
    return {k: (wider if one.corners[k, 0] > middle else -wider, 0.0) for k in ends}


def _hood(one: Outline, flat: Mapping[str, FlatMeasure], steps: Steps) -> Moves:
    return dict.fromkeys(range(len(one.corners)), (0.0, 0.0))  # it follows the neck that it is sewn to


_MOVERS = {"torso": _torso, "sleeve": _sleeve, "leg": _leg, "skirt": _skirt, "waistband": _waistband, "hood": _hood}
