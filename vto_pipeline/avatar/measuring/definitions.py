"""Definitions of the measurements: name, tape on the template, clause of ISO 8559-1:2017."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

from vto_pipeline.errors import InputError


@dataclass(frozen=True)
class Definition:
    """One measurement.

    Args:
        name: ISO 8559 style name.
        kind: "girth", "loop", "height", "drop", "path", "breadth", "depth", "span" or "mass".
        place: Row, column or landmarks it lies on; a place on a limb has no side, both sides are averaged.
        text: The definition, in our words.
        clause: Clause and title in ISO 8559-1:2017, or empty where the free preview does not name it.
    """

    name: str
    kind: str
    place: str
    text: str
    clause: str = ""


def _read(path: Path) -> dict[str, Definition]:
    with path.open(encoding="utf-8", newline="") as table:
        return {row["name"]: Definition(**row) for row in csv.DictReader(table)}


DEFINITIONS = _read(Path(__file__).with_suffix(".csv"))
"""All measurements, by name."""

_OTHER_NAMES = {
    "bust_girth": "chest_girth",
    "chest_girth_men": "chest_girth",
    "height": "stature",
    "weight": "mass",
    "arm_length": "outer_arm_length",
    "shoulder_breadth": "back_shoulder_width",
    "back_neck_to_waist_level": "back_neck_to_waist",
    "max_hip_girth": "hip_girth",
    "inseam": "inside_leg",
}


def definition(name: str) -> Definition:
    """Return what a name means, other common names included.

    Raises:
        InputError: an unknown name.
    """
    found = DEFINITIONS.get(_OTHER_NAMES.get(name, name))
    if found is None:
        raise InputError(
            f"measurement {name!r} is not known", hint=f"known: {', '.join(sorted([*DEFINITIONS, *_OTHER_NAMES]))}"
        )
    return found
