"""A pattern as a plan has it: pieces cut once or mirrored or on the fold, stood about the body, and what is sewn."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.io.patterns.fold import Fold
from vto_pipeline.io.patterns.loops import edges_points
from vto_pipeline.io.patterns.sewing_plan import PlannedPanel, SewingPlan
from vto_pipeline.model.job import Job
from vto_pipeline.model.pattern import Panel, Pattern, Placement, Side, Stitch

SIDES = {
    "front": np.eye(3),
    "back": np.diag([-1.0, 1.0, -1.0]),
    "left": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "right": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
}
"""Which side of the body a panel stands on -> where its x, y and right side point to."""

_UPRIGHT = np.array([[0.0, 0.0], [0.0, 1.0]])  # a line: panels are flipped about it
_EDGE = re.compile(r"(.+) (\d+)( mirrored)?")
_TOLERANCE_M = 1e-3  # of outlines, for where their middle is

Numbers = Mapping[tuple[int, bool], int]


def planned(pattern: Pattern, plan: SewingPlan, job: Job) -> Pattern:
    """Return a pattern of the pieces that a plan names, placed and sewn as it says.

    Args:
        pattern: The panels that pieces are cut from, in one size or more.
        plan: Pieces and seams; edges are numbered as the pattern's panels have them.
        job: Receives which panels no piece is cut from.

    Raises:
        InputError: the plan names a panel or an edge that is not there, or a side of the body that is not said.
    """
    drawn = {panel.name for panel in pattern.panels}
    pieces: list[Panel] = []
    numbers: dict[str, Numbers] = {}
    for name, wanted in plan.panels.items():
        source = wanted.of or name
        if source not in drawn:
            raise InputError(f"panels.{name}: no panel {source!r}; there are {', '.join(sorted(drawn))}")
        for panel in pattern.panels:
            if panel.name == source:
                piece, numbers[name] = _cut(panel, wanted, name)
                pieces.append(replace(piece, name=name, placement=_placed(piece, wanted, name)))
    left = sorted(drawn - {wanted.of or name for name, wanted in plan.panels.items()})
    if left:
        job.note(f"panels that the plan does not name, left out: {', '.join(left)}")
    stitches = [
        Stitch(*(tuple(_side(text, numbers, forward) for text in chain) for chain, forward in pair))
        for pair in (((seam.first, True), (seam.second, False)) for seam in plan.seams)
    ]
    return Pattern(pattern.name, tuple(pieces), tuple(stitches), pattern.unit)


def _cut(panel: Panel, wanted: PlannedPanel, name: str) -> tuple[Panel, Numbers]:
    """Return a piece, and for each edge of the panel, or of its mirror picture, which of the piece's it is."""
    count = len(panel.edges)
    order = [(edge, False) for edge in range(count)]
    if wanted.fold is not None:
        if wanted.fold >= count:
            raise InputError(f"panels.{name}.fold: no edge {wanted.fold}; the panel has {count}")
        line = panel.edges[wanted.fold].points
        fold = Fold(np.stack([line[0], line[-1]]))
        if not fold.cuts_off(panel.edges):
            raise InputError(f"panels.{name}.fold: edge {wanted.fold} is not straight, or the panel lies on both sides")
        kept = fold.half(panel.edges)
        order = [*((edge, False) for edge in kept), *((edge, True) for edge in reversed(kept))]
        panel = fold.opened_panel(panel)
    if wanted.mirrored:
        panel, order = Fold(_UPRIGHT).mirrored_panel(panel), order[::-1]
    return panel, {edge: at for at, edge in enumerate(order)}


def _placed(panel: Panel, wanted: PlannedPanel, name: str) -> Placement:
    named = [word for word in re.split(r"[^a-z]+", name.lower()) if word in SIDES]
    side = wanted.stands or (named[0] if named else "")
    if not side:
        raise InputError(f"panels.{name}: its name has none of {', '.join(SIDES)}; say where it stands")
    points = edges_points(panel.edges, _TOLERANCE_M)
    angle = np.deg2rad(wanted.turned_deg)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    turned = points @ turn[:2, :2].T
    shift = np.array(wanted.at_m) - 0.5 * (turned.min(axis=0) + turned.max(axis=0))
    return Placement(SIDES[side] @ turn, SIDES[side] @ np.array([*shift, wanted.away_m]))


def _side(text: str, numbers: Mapping[str, Numbers], forward: bool) -> Side:
    found = _EDGE.fullmatch(text.strip())
    if found is None or found[1] not in numbers:
        raise InputError(f"seams: {text!r}; expected a piece and the number of its edge, as in 'front 3'")
    edge = (int(found[2]), bool(found[3]))
    if edge not in numbers[found[1]]:
        there = ", ".join(f"{k} mirrored" if other else str(k) for k, other in numbers[found[1]])
        raise InputError(f"seams: {text!r}: {found[1]} has no such edge; there are {there}")
    return Side(found[1], numbers[found[1]][edge], forward)
