"""The movement of one of our avatars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.arrays import FloatArray, freeze
from vto_pipeline.model.motion.clip import check_frame_time

CONTACTS = ("left_heel", "left_ball", "right_heel", "right_ball")
"""Where a foot may touch the floor, in the order of the columns of `AvatarMotion.planted`."""


@dataclass(frozen=True)
class AvatarMotion:
    """A movement of one avatar; frame t is `pose_avatar(avatar, poses[t], translations[t])`.

    Args:
        joint_names: J names.
        poses: Rotation vector of each joint relative to the bind pose [rad], in the parent's frame, shape (T, J, 3).
        translations: Of the root from its place in the bind pose [m], shape (T, 3).
        planted: Which of `CONTACTS` stand still on the floor, shape (T, 4).
        frame_time: From one frame to the next [s].
    """

    joint_names: tuple[str, ...]
    poses: FloatArray
    translations: FloatArray
    planted: np.ndarray
    frame_time: float

    def __post_init__(self) -> None:
        bones, frames = len(self.joint_names), len(self.poses)
        for name, shape, dtype in (
            ("poses", (frames, bones, 3), "f8"),
            ("translations", (frames, 3), "f8"),
            ("planted", (frames, len(CONTACTS)), "?"),
        ):
            object.__setattr__(self, name, freeze(f"motion {name}", getattr(self, name), shape, dtype))
        if frames == 0:
            raise InputError("a motion has no frames; expected at least one")
        check_frame_time(self.frame_time)

    @property
    def seconds(self) -> float:
        """From the first frame to the last [s]."""
        return (len(self.poses) - 1) * self.frame_time
