"""A garment in motion, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray, freeze
from vto_pipeline.model.motion.clip import check_frame_time


@dataclass(frozen=True)
class ClothMotion:
    """A garment in motion.

    Args:
        frames: Positions [m], shape (T, V, 3).
        faces: Shape (F, 3).
        frame_time: From one frame to the next [s].
    """

    frames: FloatArray
    faces: IntArray
    frame_time: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", freeze("frames", self.frames, (None, None, 3), "f8"))
        object.__setattr__(self, "faces", freeze("faces", self.faces, (None, 3), "i4"))
        if len(self.frames) == 0:
            raise InputError("a garment's motion has no frames; expected at least one")
        check_frame_time(self.frame_time)

    @property
    def times(self) -> FloatArray:
        """When each frame is [s], shape (T,)."""
        return np.asarray(np.arange(len(self.frames)) * self.frame_time)
