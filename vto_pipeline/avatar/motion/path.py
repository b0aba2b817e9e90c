"""An avatar on its way, posed at any time."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np

from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.motion import AvatarMotion, BodyPath
from vto_pipeline.numerics.kinematics import matrix_vectors, vector_matrices

_REMEMBERED = 4  # times: steps ask for where one ends and the next begins


def avatar_path(avatar: Avatar, motion: AvatarMotion) -> BodyPath:
    """Return the avatar at any time of its motion: between frames joints turn at even speed, and so the root moves.

    Args:
        avatar: Any of our bodies.
        motion: Of this avatar.
    """
    turns = vector_matrices(motion.poses)
    last = len(motion.poses) - 1
    known: OrderedDict[float, FloatArray] = OrderedDict()

    def posed(time: float) -> FloatArray:
        place = min(max(time / motion.frame_time, 0.0), float(last))
        first = min(int(place), max(last - 1, 0))
        share, after = place - first, min(first + 1, last)
        way = matrix_vectors(turns[after] @ np.swapaxes(turns[first], -1, -2))
        pose = matrix_vectors(vector_matrices(share * way) @ turns[first])
        root = (1.0 - share) * motion.translations[first] + share * motion.translations[after]
        return pose_avatar(avatar, pose, root).vertices

    def at(time: float) -> FloatArray:
        if time not in known:
            known[time] = np.array(posed(time))  # writable, as compiled code has it
            if len(known) > _REMEMBERED:
                known.popitem(last=False)
        return known[time]

    return BodyPath(at, avatar.faces, len(motion.poses), motion.frame_time)
