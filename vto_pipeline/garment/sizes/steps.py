"""By how much one size is larger than another: the chest by EN 13402-3, all else by the rules of the type."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from vto_pipeline.garment.sizes.rules import SizeRules
from vto_pipeline.io.bodies.size_letters import chest_range, letter_number


@dataclass(frozen=True)
class Steps:
    """Differences between two sizes.

    Args:
        girths: Name -> difference of the whole girth [m]; 0 where the rules name none.
        lengths: Name -> difference [m].
    """

    girths: Mapping[str, float]
    lengths: Mapping[str, float]

    def girth(self, name: str) -> float:
        """Return the difference of a whole girth [m]."""
        return self.girths.get(name, 0.0)

    def length(self, name: str) -> float:
        """Return the difference of a length [m]."""
        return self.lengths.get(name, 0.0)

    def flat(self, name: str) -> float | None:
        """Return the difference of a flat measurement [m]; None: the rules leave it to what else moves."""
        if name in self.girths:
            return 0.5 * self.girths[name]
        if name == "length" and name in self.lengths:
            return self.length("bodice") + self.length("length")  # of a dress both
        return self.lengths.get(name)

    def corrected(self, missing: Mapping[str, float]) -> Steps:
        """Return larger steps, by what flat measurements lack [m]."""
        girths = {name: step + 2.0 * missing.get(name, 0.0) for name, step in self.girths.items()}
        return Steps(girths, {name: step + missing.get(name, 0.0) for name, step in self.lengths.items()})


def steps_between(rules: SizeRules, base: str, size: str) -> Steps:
    """Return by how much a size is larger than the base.

    Args:
        rules: Of the type of garment.
        base, size: Letters, such as "M" and "XL".

    Raises:
        InputError: no such letter.
    """
    chest = sum(chest_range(size, rules.sex)) / 2.0 - sum(chest_range(base, rules.sex)) / 2.0
    count = letter_number(size) - letter_number(base)
    girths: dict[str, float] = {name: share * chest for name, share in rules.girth_shares.items()}
    return Steps(girths, {name: 1e-3 * step * count for name, step in rules.lengths_mm.items()})
