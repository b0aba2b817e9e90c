"""A body on its way: its shape at any time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray, freeze
from vto_pipeline.model.motion.clip import check_frame_time


@dataclass(frozen=True)
class BodyPath:
    """A body that moves, with frames at even times from 0 on.

    Args:
        at: Time [s], between the first frame and the last -> vertices [m], shape (V, 3).
        faces: Shape (F, 3).
        frames: How many.
        frame_time: From one to the next [s].
    """

    at: Callable[[float], FloatArray]
    faces: IntArray
    frames: int
    frame_time: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "faces", freeze("faces", self.faces, (None, 3), "i4"))
        if self.frames < 1:
            raise InputError(f"a body's path has {self.frames} frames; expected at least one")
        check_frame_time(self.frame_time)

    def time(self, frame: int) -> float:
        """Return when a frame is [s]."""
        return frame * self.frame_time
