"""Levels of a stage: what it can be run at for less time and more error than by default, or the other way round."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vto_pipeline.model.settings import Config


@dataclass(frozen=True)
class Level:
    """One way to run a stage, as measured against the stage by default.

    Args:
        settings: Setting -> value. None for a stage that can stop in time: it is given as long.
        seconds: Section -> its time as a share of that by default: of the stage itself, and of later ones.
        error: Of what the run makes, as a multiple of that by default.
    """

    settings: Mapping[str, Any]
    seconds: Mapping[str, float]
    error: float


DEFAULT = Level({}, {}, 1.0)


@dataclass(frozen=True)
class UsualTime:
    """What a stage takes by default where it has never run: on the machine that its levels were measured on, quiet.

    Args:
        seconds: Whatever is given [s].
        per_file: Besides, for each file of what it is made from [s].
        kind: Which files count: what follows the role under `given` in a document, such as "photos".
        power: Of their number.
    """

    seconds: float
    per_file: float = 0.0
    kind: str = ""
    power: float = 1.0

    def of(self, files: Mapping[str, float]) -> float:
        """Return the time, by the number of files of each kind [s]."""
        return self.seconds + self.per_file * math.pow(files.get(self.kind, 0.0), self.power)


def shares_as_stated(levels: Sequence[Level], settings: Config) -> dict[str, float]:
    """Return section -> its time as a share of that by default, where a number that levels change is stated.

    Time is taken as a power of it, the one that the coarsest level tells.

    Args:
        levels: Of a stage. Those that change more than one setting, or what is no number, tell of none.
        settings: Of the stage, as stated.
    """
    found: dict[str, float] = {}
    for level in levels:
        for name, value in level.settings.items() if len(level.settings) == 1 else ():
            default = type(settings).model_fields[name].default
            if name in settings.model_fields_set and isinstance(value, int | float) and 0 not in (value, default):
                power = math.log(getattr(settings, name) / default) / math.log(value / default)
                found = {section: share**power for section, share in level.seconds.items()}
    return found
