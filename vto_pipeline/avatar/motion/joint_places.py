"""Where an avatar's joints are in many poses."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.numerics.kinematics import vector_matrices, world_transforms


def posed_joints(avatar: Avatar, poses: FloatArray, root: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return world rotations relative to the bind pose, and places of the joints, (T, J, 3, 3) and (T, J, 3).

    Args:
        avatar: Any of our bodies.
        poses: Rotation vectors in the parents' frames [rad], shape (T, J, 3).
        root: Places of the root [m], shape (T, 3).
    """
    parents = avatar.parents.tolist()
    offsets = np.array([avatar.joints[j] - avatar.joints[max(parent, 0)] for j, parent in enumerate(parents)])
    local = np.tile(offsets, (len(poses), 1, 1))
    local[:, [j for j, parent in enumerate(parents) if parent < 0]] = root[:, None]
    return world_transforms(parents, vector_matrices(poses), local)
