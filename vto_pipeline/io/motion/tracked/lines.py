"""Places of joints from JSON lines: by name, or the 33 landmarks of MediaPipe's pose."""

from __future__ import annotations

import json
import math
from codecs import BOM_UTF8
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError
from vto_pipeline.io.motion.joint_map import joints_by_name
from vto_pipeline.model.arrays import FloatArray

_SIDES = ("left", "right")
LANDMARKS = {
    "nose": 0,
    **{f"{side}_ear": 7 + k for k, side in enumerate(_SIDES)},
    **{f"{side}_{joint}": 11 + k for k, (joint, side) in enumerate(product(("shoulder", "elbow", "wrist"), _SIDES))},
    **{f"{side}_{joint}": 23 + k for k, (joint, side) in enumerate(product(("hip", "knee", "ankle"), _SIDES))},
    **{f"{side}_toe": 31 + k for k, side in enumerate(_SIDES)},
}
"""Our joint -> its landmark in MediaPipe's order (BlazePose, Bazarevsky et al. 2020)."""

_COUNT = 33
_WORLD = ("world_landmarks", "pose_world_landmarks", "landmarks", "pose_landmarks")
_JOINTS = ("joints", "keypoints")
_TIMES = {"time_s": 1.0, "t": 1.0, "timestamp": 1.0, "time_ms": 1e-3, "timestamp_ms": 1e-3, "timestamp_us": 1e-6}
_SEEN = 0.5  # visibility or confidence below which a joint is a guess
_MOST_FRAMES, _LARGEST = 200_000, 1e6
_HINT = 'a line is {"time_s": 0.5, "joints": {"left_hip": [x, y, z], ...}} or {"world_landmarks": [33 of [x, y, z]]}'


@dataclass(frozen=True)
class TrackedFrames:
    """Where joints were seen.

    Args:
        places: Joint -> places in the file's unit and axes, NaN where it was not seen, shape (T, 3).
        times: [s], shape (T,), or None where the lines say none.
        convention: How the joints are named; landmarks are named as ours are.
    """

    places: Mapping[str, FloatArray]
    times: FloatArray | None
    convention: str


def read_lines(path: Path) -> TrackedFrames:
    """Read a file of frames, one a line; blank lines are skipped.

    Raises:
        FormatError: a line is no JSON, or holds no joints; with the line's number.
    """
    frames: list[dict[str, list[float]]] = []
    times: list[float] = []
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            line = line.removeprefix(BOM_UTF8)
            if not line.strip():
                continue
            where = f"{path}, line {number}"
            if len(frames) == _MOST_FRAMES:
                raise FormatError(f"more than {_MOST_FRAMES} frames", where=where)
            try:
                record = json.loads(line)
            except (ValueError, RecursionError):
                raise FormatError("not a line of JSON", where=where, hint=_HINT) from None
            frames.append(joints_in(record, where))
            times += times_in(record)
    if not frames:
        raise FormatError("no frames", where=str(path), hint=_HINT)
    if len(times) not in (0, len(frames)):
        raise FormatError(f"{len(times)} of {len(frames)} frames say when they were", where=str(path))
    names = sorted({name for frame in frames for name in frame})
    convention, known = our_joints(names)
    nowhere = [math.nan] * 3
    places = {ours: np.array([frame.get(theirs, nowhere) for frame in frames]) for ours, theirs in known.items()}
    return TrackedFrames(places, np.array(times) if times else None, convention)


def our_joints(names: Sequence[str]) -> tuple[str, dict[str, str]]:
    """Return the convention that joints are named by, and our joint -> its name there."""
    if set(names) <= set(LANDMARKS):
        return "ours", {name: name for name in names}
    return joints_by_name(names)


def times_in(record: Mapping[str, Any]) -> list[float]:
    """Return when a frame says that it was [s], alone in a list; empty where it says nothing."""
    return [float(record[key]) * unit for key, unit in _TIMES.items() if _is_number(record.get(key))][:1]


def joints_in(record: Any, where: str) -> dict[str, list[float]]:
    """Return the joints that a frame holds, by the file's names, or by ours where it has landmarks.

    Args:
        record: A line's JSON value.
        where: The line, for messages.

    Raises:
        FormatError: it holds none, or a place is not three numbers.
    """
    if not isinstance(record, dict):
        raise FormatError("a frame is not an object", where=where, hint=_HINT)
    for key in _WORLD:
        if isinstance(record.get(key), list):
            marks = record[key]
            if len(marks) == 1 and isinstance(marks[0], list) and len(marks[0]) == _COUNT:
                marks = marks[0]  # of the first person
            if len(marks) == 0:
                return {}
            if len(marks) != _COUNT:
                raise FormatError(f"{len(marks)} landmarks; expected {_COUNT}", where=where, hint=_HINT)
            return _seen({name: marks[k] for name, k in LANDMARKS.items()}, where)
    for key in _JOINTS:
        if isinstance(record.get(key), dict):
            return _seen(record[key], where)
    raise FormatError("a frame without joints", where=where, hint=_HINT)


def _seen(found: Mapping[str, Any], where: str) -> dict[str, list[float]]:
    """Return the places of the joints that were seen well enough."""
    kept: dict[str, list[float]] = {}
    for name, value in found.items():
        trust: Any = 1.0
        if isinstance(value, dict):
            trust = value.get("visibility", value.get("confidence", 1.0))
            value = [value.get(axis) for axis in "xyz"]
        elif isinstance(value, list) and len(value) == 4:
            *value, trust = value
        if value is None or trust is None:
            continue
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, [*value, trust])):
            raise FormatError(f"{name!r:.60} is not a place of three numbers", where=where, hint=_HINT)
        if trust >= _SEEN and all(abs(number) < _LARGEST for number in value):
            kept[name] = [float(number) for number in value]
    return kept


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
