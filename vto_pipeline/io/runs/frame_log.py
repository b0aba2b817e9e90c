"""Frames of a garment in motion as they come, so that an interrupted run goes on where it was; draped_motion.npz."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import FormatError, InputError
from vto_pipeline.io.arrays import Arrays, read_arrays, write_arrays
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.motion import ClothMotion

_STATE = "state.npz"


class FrameLog:
    """Frames that are kept in a folder; without one, in memory.

    A frame is written before the state from which the next one follows, and each file is renamed into place. So the
    state is never ahead of the frames.

    Args:
        folder: Theirs alone, or None.

    Attributes:
        frames: Positions [m], shape (V, 3) each.
        records: What was found in each, as JSON values.
        state: Arrays that the next frame follows from; empty where there is none yet.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self.frames: list[FloatArray] = []
        self.records: list[Mapping[str, Any]] = []
        self.state: Arrays = {}
        if folder is not None and (folder / _STATE).is_file():
            try:
                self._read(folder)
            except InputError:  # cut off in the middle of a write that a power failure undid: begin again
                self.frames, self.records, self.state = [], [], {}

    def add(self, positions: FloatArray, record: Mapping[str, Any], state: Mapping[str, Any]) -> None:
        """Keep a frame [m], shape (V, 3), what was found in it, and the arrays that the next one follows from."""
        number = len(self.frames)
        self.frames.append(positions.copy())
        self.records.append(record)
        self.state = {name: np.asarray(value) for name, value in state.items()}
        if self._folder is not None:
            write_arrays(
                self._folder / _name(number), {"positions": positions, "record": np.array(json.dumps(dict(record)))}
            )
            write_arrays(self._folder / _STATE, {**self.state, "count": np.int64(number + 1)})

    def _read(self, folder: Path) -> None:
        state = read_arrays(folder / _STATE, required=("count",))
        for number in range(int(state.pop("count"))):
            arrays = read_arrays(folder / _name(number), required=("positions", "record"))
            self.frames.append(arrays["positions"])
            self.records.append(json.loads(str(arrays["record"])))
        self.state = state


def _name(number: int) -> str:
    return f"frame_{number:06d}.npz"


def write_cloth_motion(path: Path, motion: ClothMotion) -> None:
    """Write draped_motion.npz: frames (T, V, 3) [m], times_s (T,), faces (F, 3)."""
    write_arrays(path, {"frames": motion.frames, "times_s": motion.times, "faces": motion.faces})


def read_cloth_motion(path: Path) -> ClothMotion:
    """Read what `write_cloth_motion` wrote.

    Raises:
        InputError: no such file; FormatError: not the motion of a garment.
    """
    arrays = read_arrays(path, required=("frames", "times_s", "faces"))
    times: Sequence[float] = arrays["times_s"].tolist()
    try:
        return ClothMotion(arrays["frames"], arrays["faces"], times[1] - times[0] if len(times) > 1 else 1.0)
    except (InputError, TypeError, ValueError) as e:
        raise FormatError(f"not the motion of a garment: {e}", where=str(path)) from None
