"""Types of garment: which panel is which part of it, and by how much its measures differ from size to size."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path
from typing import Literal

from pydantic import Field

from vto_pipeline.errors import ConfigError, GarmentError
from vto_pipeline.io.documents import check_schema, load_yaml, suggest
from vto_pipeline.model.pattern import Pattern
from vto_pipeline.model.settings import Config

Part = Literal["torso", "sleeve", "leg", "skirt", "waistband", "hood"]
Girth = Literal["chest", "waist", "hem", "neck", "cuff", "thigh"]
Length = Literal["shoulder", "armhole_depth", "bodice", "length", "sleeve", "rise", "inseam"]

_FOLDER = Path(__file__).with_name("rules")


class SizeRules(Config):
    """A type of garment."""

    schema_: Literal[1] = Field(alias="schema", description="Of this file")
    garment: str = Field(description="Name of the type")
    names: list[str] = Field([], description="Words in names of files and panels that suggest the type")
    panels: dict[str, Part] = Field(description="Name of a panel, with * and ?, -> its part; the first that fits holds")
    sex: Literal["female", "male"] = Field("female", description="Whose letter sizes: EN 13402-3 has two tables")
    allowances: str = Field(description="Kind of garment in the table of wearing ease")
    may_be_loose: list[str] = Field([], description="Zones that may be any wider than the table says: flared by design")
    girth_shares: dict[Girth, float] = Field({}, description="Step of a girth as a share of the step of the chest")
    lengths_mm: dict[Length, float] = Field({}, description="Step of a length from one size to the next [mm]")
    source: str = Field(description="Where the steps come from")

    def part_of(self, panel: str) -> Part:
        """Return which part of the garment a panel is.

        Raises:
            GarmentError: no row of the rules fits its name.
        """
        name = panel.casefold()
        for wanted, part in self.panels.items():
            if fnmatchcase(name, wanted.casefold()):
                return part
        problem = f"panel {panel!r}: not a part of a {self.garment} by its name"
        raise GarmentError(problem, hint=f"names that the rules know: {', '.join(self.panels)}")


@cache
def rule_names() -> tuple[str, ...]:
    """Return the types of garment that come with the package, sorted."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.yaml")))


def read_rules(rules: str) -> SizeRules:
    """Read the rules of a type of garment.

    Args:
        rules: Name of a type, or path of a YAML file.

    Raises:
        ConfigError: neither, or a key that is unknown or missing, with its line.
    """
    if rules in rule_names():
        path = _FOLDER / f"{rules}.yaml"
    elif Path(rules).suffix.lower() in (".yaml", ".yml"):
        path = Path(rules)
    else:
        problem = f"{rules!r} is neither a type of garment nor a YAML file of rules"
        raise ConfigError(problem, hint=suggest(rules, rule_names()))
    read: SizeRules = check_schema(load_yaml(path), SizeRules)
    return read


def guess_rules(pattern: Pattern) -> tuple[SizeRules, str]:
    """Return the rules that the names of a pattern suggest, and the reason in words.

    Raises:
        GarmentError: the names suggest no type, or several.
    """
    found: dict[str, tuple[str, SizeRules]] = {}
    for name in rule_names():
        rules = read_rules(name)
        said = next((word for word in rules.names if _has_word(pattern.name, word)), None)
        if said is not None:
            found[name] = (said, rules)
    if len(found) != 1:
        problem = f"what kind of garment {pattern.name!r} is does not show in its name"
        if found:
            problem += f": {', '.join(word for word, _ in found.values())}"
        raise GarmentError(problem, hint=f"state it with --type: {', '.join(rule_names())}, or a file of rules")
    ((word, rules),) = found.values()
    return rules, f"{word!r} is in its name"


def _has_word(name: str, word: str) -> bool:
    return re.search(rf"(?<![a-z]){word}(?![a-rt-z])", name.casefold()) is not None
