"""Stance of a registered body: it keeps its posture, only the arms are moved aside.

A tailor measures a person as they stand. So the trunk, the neck and the legs of a body that stands keep the scan's
posture as their bind pose, and what the tape reads there is what a slice of the scan gives; only the arms are brought
to the A-pose of the template. A body that does not stand is brought to the template's pose as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.fit import Fit
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.template.template import ARM, JOINT_KINDS
from vto_pipeline.model.arrays import FloatArray

_BEARING = ("pelvis", "spine", "chest", "hip", "knee")
_MAX_LEAN_RAD = 0.5
"""Of any part of trunk and legs; people who stand with their feet apart stay well below."""


@dataclass(frozen=True)
class Stance:
    """A skeleton at rest and how it is turned in the scan.

    Args:
        joints: In the bind pose [m], shape (J, 3).
        pose: From there to the scan: rotation vectors in the parents' frames, shape (J, 3).
        translation: [m], shape (3,).
        yaw: Turns +Z to where the body faces, shape (3, 3).
        lean: The largest turn of a part of trunk and legs away from upright [rad].
    """

    joints: FloatArray
    pose: FloatArray
    translation: FloatArray
    yaw: FloatArray
    lean: float

    @property
    def stands(self) -> bool:
        """Whether its girths can be read off the scan level by level."""
        return self.lean < _MAX_LEAN_RAD


def stance(space: ShapeSpace, fit: Fit) -> Stance:
    """Return how a registered body stands."""
    parents = space.base.parents
    joints = space.joints(fit.parameters)
    rotation, offset = joint_transforms(joints, parents, fit.pose)
    place = np.einsum("jab,jb->ja", rotation, joints) + offset + fit.translation
    forward = rotation[0] @ [0.0, 0.0, 1.0]
    yaw = Rotation.from_rotvec([0.0, np.arctan2(forward[0], forward[2]), 0.0]).as_matrix()
    own = ~np.isin(JOINT_KINDS, ARM)
    # upright is what counts: a foot turned out leans nowhere
    up = rotation[np.isin(JOINT_KINDS, _BEARING), 1, 1]
    lean = float(np.arccos(np.clip(up.min(), -1.0, 1.0)))
    if lean >= _MAX_LEAN_RAD:
        return Stance(joints, fit.pose, fit.translation, yaw, lean)
    rest = joints.copy()
    world = np.where(own[:, None, None], yaw, rotation)
    pose = np.zeros_like(fit.pose)
    for j, parent in enumerate(parents):
        if parent < 0:
            pose[j] = Rotation.from_matrix(yaw).as_rotvec()
            continue
        # what hangs from the trunk starts where it does in the scan; an arm hangs straight
        rest[j] = (place[j] - place[0]) @ yaw + rest[0] if own[parent] else rest[parent] + joints[j] - joints[parent]
        pose[j] = Rotation.from_matrix(world[parent].T @ world[j]).as_rotvec()
    return Stance(rest, pose, place[0] - rest[0], yaw, lean)
