"""Joints that a camera follows, line by line as they come."""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.motion.tracked.lines import joints_in, our_joints, times_in
from vto_pipeline.io.motion.tracked.parse import NEEDED, refuse_points
from vto_pipeline.model.arrays import FloatArray


@dataclass(frozen=True)
class LiveFrame:
    """Where joints are now.

    Args:
        places: Joint -> place in the camera's unit and axes, shape (3,).
        seconds: When that was, by the camera's clock [s]; None where the line does not say.
    """

    places: Mapping[str, FloatArray]
    seconds: float | None


class LiveJoints:
    """Reads frames one by one; a joint that is not seen in one stays where it was about the hips.

    Args:
        source: Of the lines, for messages.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._number = 0
        self._names: set[str] = set()
        self._known: dict[str, str] = {}
        self._hips = np.zeros(3)
        self._about: dict[str, FloatArray] = {}

    @property
    def missing(self) -> tuple[str, ...]:
        """Joints that are needed and were not seen yet."""
        return tuple(name for name in NEEDED if name not in self._about)

    def read(self, line: bytes) -> LiveFrame | None:
        """Return the frame of the next line; None where it shows no joint, or one that is needed was never seen.

        Raises:
            FormatError: the line is no frame, holds what is no number, or shows bones without length; with its number.
                The next line may be read all the same.
        """
        self._number += 1
        where = f"{self._source}, line {self._number}"
        line = line.removeprefix(BOM_UTF8)
        if not line.strip():
            return None
        try:
            record = json.loads(line, parse_constant=partial(_refuse, where))
        except (ValueError, RecursionError):
            raise FormatError("not a line of JSON", where=where) from None
        seen = self._ours(joints_in(record, where))
        if not seen:
            return None
        hips = [seen[name] for name in ("left_hip", "right_hip") if name in seen]
        middle = np.mean(hips, axis=0) if len(hips) == 2 else self._hips
        about = self._about | {name: place - middle for name, place in seen.items()}
        places = {name: middle + place for name, place in about.items()}
        if all(name in places for name in NEEDED):
            refuse_points({name: place[None] for name, place in places.items()}, where)
        self._hips, self._about = middle, about
        return None if self.missing else LiveFrame(places, next(iter(times_in(record)), None))

    def _ours(self, seen: Mapping[str, list[float]]) -> dict[str, FloatArray]:
        """Return the places of our joints among those that were seen."""
        if not self._names.issuperset(seen):
            self._names.update(seen)
            self._known = our_joints(sorted(self._names))[1]
        return {ours: np.array(seen[theirs]) for ours, theirs in self._known.items() if theirs in seen}


def _refuse(where: str, constant: str) -> None:
    raise FormatError(f"{constant} is not a place", where=where)
