"""The frames of a BVH file: what follows MOTION."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.errors import FormatError
from vto_pipeline.io.text_numbers import parse_numbers
from vto_pipeline.model.arrays import FloatArray

_FRAMES = re.compile(r"\s*frames\s*:?\s*(\d+)\s*$", re.I)
_FRAME_TIME = re.compile(r"\s*frame\s*time\s*:?\s*(\S+)\s*$", re.I)
_LARGEST = 1e7  # a larger number is no place and no angle
_ONE_FRAME_S = 1 / 30


@dataclass(frozen=True)
class BvhFrames:
    """The numbers of a file.

    Args:
        values: One row a frame, zero where it is lost, shape (T, channels).
        lost: Which frames are not whole, shape (T,).
        frame_time: [s].
        warnings: What is wrong with the file.
    """

    values: FloatArray
    lost: NDArray[np.bool_]
    frame_time: float
    warnings: list[str]


def read_frames(lines: list[str], start: int, channels: int, path: Path) -> BvhFrames:
    """Read the frames.

    Args:
        lines: Of the file.
        start: Index of the first after MOTION.
        channels: Numbers of a frame.
        path: The file, for messages.

    Raises:
        FormatError: no frame time, no frame, or a token is not a number; with the line.
    """
    promised: int | None = None
    frame_time: float | None = None
    data, numbers = [], []
    for number, line in enumerate(lines[start:], start=start + 1):
        found = _FRAMES.match(line) if promised is None else None
        time = _FRAME_TIME.match(line) if frame_time is None else None
        if found:
            promised = int(found[1][:12])
        elif time:
            frame_time = _seconds(time[1], f"{path}, line {number}")
        elif line.strip():
            data.append(line)
            numbers.append(number)
    if frame_time is None:
        raise FormatError("no line 'Frame Time:' with the seconds of a frame", where=str(path))
    warnings: list[str] = []
    values, lost = _rows(data, numbers, channels, path, warnings)
    if len(values) == 0:
        raise FormatError("no frame", where=str(path), hint="is it cut off?")
    if promised is not None and promised != len(values):
        warnings.append(f"the header promises {promised} frames, the file holds {len(values)}")
    if frame_time == 0.0:
        if len(values) > 1:
            raise FormatError("the frame time is 0 s", where=str(path), hint="write the seconds of a frame")
        frame_time = _ONE_FRAME_S  # a single pose
    odd = ~np.isfinite(values).all(axis=1) | (abs(values) > _LARGEST).any(axis=1)
    lost = lost | odd
    return BvhFrames(np.where(lost[:, None], 0.0, values), lost, frame_time, warnings)


def _seconds(word: str, where: str) -> float:
    try:
        seconds = float(word)
    except ValueError:
        seconds = math.nan
    if not 0 <= seconds < 1e3:
        raise FormatError(f"the frame time is {word[:40]!r}; expected seconds", where=where)
    return seconds


def _rows(
    data: list[str], numbers: list[int], channels: int, path: Path, warnings: list[str]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Frames and which are lost: a line each, or where lines are broken anywhere, one stream of numbers."""
    counts = np.array([len(line.split()) for line in data], dtype=np.int64)
    whole = counts == channels
    if 2 * whole.sum() > len(data):
        values = np.zeros((len(data), channels))
        kept = [k for k in range(len(data)) if whole[k]]
        found = parse_numbers([data[k] for k in kept], [numbers[k] for k in kept], path)
        values[whole] = found.reshape(-1, channels)
        if not whole.all():
            first = int(np.flatnonzero(~whole)[0])
            warnings.append(
                f"{int((~whole).sum())} frames do not have the {channels} numbers of a frame; "
                f"the first is in line {numbers[first]}, with {counts[first]}"
            )
        return values, ~whole
    stream = parse_numbers(data, numbers, path)
    rest = len(stream) % channels
    if rest:
        warnings.append(f"the last frame has {rest} of {channels} numbers; it is left out")
    values = stream[: len(stream) - rest].reshape(-1, channels)
    return values, np.zeros(len(values), dtype=bool)
