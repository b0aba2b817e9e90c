"""Time shared out over stages: of all combinations of their levels, the one with the least error that fits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from vto_pipeline.pipeline.levels import Level

Offers = Mapping[str, Sequence[Level]]
"""Section -> the levels it may be run at."""


@dataclass(frozen=True)
class Shares:
    """One combination of levels.

    Args:
        levels: Section -> number of its level among those offered.
        seconds: What all stages take [s].
        error: Of what they make, as a multiple of that by default.
    """

    levels: Mapping[str, int]
    seconds: float
    error: float


def share_out(seconds: Mapping[str, float], offers: Offers, left: float) -> Shares:
    """Return the combination of the least error that fits, of equals the quickest; the quickest of all where none does.

    The time of a stage is multiplied by what each level makes of it, and errors by each other. There are few levels, so
    every combination is looked at.

    Args:
        seconds: Stage -> what it takes by default [s]; its section is what follows the last dot.
        offers: At least one level of each section.
        left: Time that they may take [s].
    """
    sections = list(offers)
    by_section: dict[str, float] = {}
    for name, taken in seconds.items():
        section = name.rpartition(".")[2]
        by_section[section] = by_section.get(section, 0.0) + taken
    best, order = None, None
    for numbers in product(*(range(len(offers[section])) for section in sections)):
        levels = [offers[section][number] for section, number in zip(sections, numbers, strict=True)]
        taken = sum(one * factor(levels, section) for section, one in by_section.items())
        error = prod(level.error for level in levels)
        late = taken > left
        merit = (late, taken if late else error, error if late else taken)
        if order is None or merit < order:
            best, order = Shares(dict(zip(sections, numbers, strict=True)), taken, error), merit
    assert best is not None  # the product of no sections has one member
    return best


def factor(levels: Sequence[Level], section: str) -> float:
    """Return what levels make of the time of a section's stages."""
    return prod(level.seconds.get(section, 1.0) for level in levels)
