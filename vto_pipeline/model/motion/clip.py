"""A moving skeleton, as a file holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, IntArray, freeze

_LONGEST_FRAME_S = 10.0


@dataclass(frozen=True)
class Clip:
    """A moving skeleton as a file holds it.

    Args:
        joint_names: J names.
        parents: Index of each joint's parent, which comes before it; -1 for a root, shape (J,).
        offsets: Each joint's place at rest, in its parent's frame [m], shape (J, 3).
        rest: Each joint's rotation at rest, in its parent's frame, unit quaternions, shape (J, 4).
        rotations: The same in each frame, shape (T, J, 4).
        translations: Each joint's place in its parent's frame [m], shape (T, J, 3); constant but for roots and for
            bones that change their length.
        frame_time: From one frame to the next [s].
    """

    joint_names: tuple[str, ...]
    parents: IntArray
    offsets: FloatArray
    rest: FloatArray
    rotations: FloatArray
    translations: FloatArray
    frame_time: float

    def __post_init__(self) -> None:
        bones, frames = len(self.joint_names), len(self.rotations)
        for name, shape, dtype in (
            ("parents", (bones,), "i4"),
            ("offsets", (bones, 3), "f8"),
            ("rest", (bones, 4), "f8"),
            ("rotations", (frames, bones, 4), "f8"),
            ("translations", (frames, bones, 3), "f8"),
        ):
            object.__setattr__(self, name, freeze(f"clip {name}", getattr(self, name), shape, dtype))
        if bones == 0 or frames == 0:
            raise InputError(f"a clip has {bones} joints and {frames} frames; expected at least one of each")
        if (self.parents < -1).any() or (self.parents >= np.arange(bones)).any():
            raise InputError("clip parents: each joint needs a parent before it, or -1")
        for quaternions in (self.rest, self.rotations):
            if (abs(np.linalg.norm(quaternions, axis=-1) - 1.0) > 1e-6).any():
                raise InputError("clip rotations: a quaternion is not of unit length")
        check_frame_time(self.frame_time)

    @property
    def seconds(self) -> float:
        """From the first frame to the last [s]."""
        return (len(self.rotations) - 1) * self.frame_time


def check_frame_time(seconds: float) -> None:
    """Refuse a time from frame to frame that is none.

    Raises:
        InputError: it is not above 0, or above 10 s.
    """
    if not 0 < seconds <= _LONGEST_FRAME_S:
        raise InputError(f"the frame time is {seconds} s; expected more than 0 and at most {_LONGEST_FRAME_S:g} s")
