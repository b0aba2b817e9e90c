"""A pattern in other sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vto_pipeline.errors import GarmentError, InputError
from vto_pipeline.garment.pattern.figures import seam_figures
from vto_pipeline.garment.sizes.anchors import anchor_moves
from vto_pipeline.garment.sizes.balance import balanced, proportional
from vto_pipeline.garment.sizes.flat import FlatMeasure, flat_measurements
from vto_pipeline.garment.sizes.morph import moved_panel
from vto_pipeline.garment.sizes.outline import outlines
from vto_pipeline.garment.sizes.rules import SizeRules
from vto_pipeline.garment.sizes.steps import Steps, steps_between
from vto_pipeline.io.bodies.size_letters import letter_number
from vto_pipeline.io.patterns.loops import edges_area
from vto_pipeline.model.pattern import Panel, Pattern

_FOLDED = 0.2  # of the area of a panel: what shrinks below it is no smaller size of it
_ROUNDS = 4
_ENOUGH_M = 1e-5


@dataclass(frozen=True)
class SizeRow:
    """A size of a chart.

    Args:
        size: Its letter.
        flat: Flat measurements.
        asked: Those that the rules ask for [m]; a girth is half of itself.
        mismatch: By how much the worst seam fits worse than in the base, of the length that it would have to have [m].
        made: How: "base", "graded", or "from the file".
    """

    size: str
    flat: Mapping[str, FlatMeasure]
    asked: Mapping[str, float]
    mismatch: float
    made: str


def grade(pattern: Pattern, rules: SizeRules, base: str, sizes: Sequence[str]) -> tuple[Pattern, list[SizeRow]]:
    """Make sizes of a pattern by rules.

    Args:
        pattern: Of one size, or of several, which are kept where they are asked for.
        rules: Of its type.
        base: The size that the others are made from; for a pattern without sizes, the one it is said to have.
        sizes: Letters of those asked for.

    Returns:
        The pattern in all sizes asked for, from the smallest, and a row of the chart for each.

    Raises:
        InputError: no such letter, or the pattern has sizes and the base is not among them.
        GarmentError: a panel cannot be graded by these rules.
    """
    held = {size or base: size for size in pattern.sizes}
    if base not in held:
        raise InputError(f"the pattern has no size {base!r}; there are {', '.join(held)}", hint="state one with --base")
    start = pattern.of_size(held[base])
    flat = flat_measurements(start, rules)
    panels: list[Panel] = []
    rows: list[SizeRow] = []
    for size in sorted(dict.fromkeys(sizes), key=letter_number):
        steps = steps_between(rules, base, size)
        asked = {name: one.value + step for name, one in flat.items() if (step := steps.flat(name)) is not None}
        if size in held:
            made = "base" if size == base else "from the file"
            one = pattern.of_size(held[size])
            one = replace(one, panels=tuple(replace(panel, size=size) for panel in one.panels))
        else:
            made, one = "graded", _as_asked(start, rules, flat, steps, asked, size)
        rows.append(SizeRow(size, flat_measurements(one, rules), asked, _mismatch(start, one), made))
        panels += one.panels
    return replace(pattern, panels=tuple(panels), stitches=start.stitches), rows


def _as_asked(
    start: Pattern,
    rules: SizeRules,
    flat: Mapping[str, FlatMeasure],
    steps: Steps,
    asked: Mapping[str, float],
    size: str,
) -> Pattern:
    """Return a size whose measurements are those asked for: a slanted seam grows by less than its ends move."""
    for _ in range(_ROUNDS):
        one = _graded(start, rules, flat, steps, size)
        found = flat_measurements(one, rules)
        missing = {name: value - found[name].value for name, value in asked.items()}
        if max(map(abs, missing.values()), default=0.0) < _ENOUGH_M:
            break
        steps = steps.corrected(missing)
    return one


def _graded(start: Pattern, rules: SizeRules, flat: Mapping[str, FlatMeasure], steps: Steps, size: str) -> Pattern:
    named = outlines(start, rules)
    moves = {name: proportional(one, anchor_moves(one, flat, steps)) for name, one in named.items()}
    moves = balanced(named, start.stitches, moves)
    panels = []
    for panel in start.panels:
        one = moved_panel(panel, moves[panel.name] @ named[panel.name].frame, size)
        if edges_area(one.edges) < _FOLDED * edges_area(panel.edges):
            problem = f"panel {panel.name!r} would fold over itself in size {size}"
            raise GarmentError(problem, hint="its steps are larger than the panel; give rules with smaller ones")
        panels.append(one)
    return replace(start, panels=tuple(panels))


def _mismatch(start: Pattern, one: Pattern) -> float:
    """Return by how much a seam is longer or shorter than at the base's ratio of both sides, the worst of all [m]."""
    pairs = zip(seam_figures(start), seam_figures(one), strict=True)
    off = [abs(b.lengths[1] - b.lengths[0] * a.lengths[1] / a.lengths[0]) for a, b in pairs]
    return max(off, default=0.0)
