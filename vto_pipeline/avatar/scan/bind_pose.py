"""Transfer of a displaced body back to its bind pose, without flipped or crossing faces in either pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.avatar.model.fit import Fit
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms, skin_transforms
from vto_pipeline.avatar.model.stance import Stance
from vto_pipeline.avatar.scan.displacement import untangle_displacement
from vto_pipeline.avatar.template.template import JOINTS, membership
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

_MENDING_ROUNDS = 3
_THIGH_GAP_M = 0.001
_LEFT_KNEE = JOINTS.index("left_knee")


def separate_thighs(space: ShapeSpace, fit: Fit, vertices: FloatArray) -> FloatArray:
    """Keep each leg on its own side of the pelvis' median plane: thighs that touch in the scan must not cross."""
    rotation, offset = joint_transforms(space.joints(fit.parameters), space.base.parents, fit.pose)
    local = (vertices - fit.translation - offset[0]) @ rotation[0]
    at_rest = space.base.bind_vertices
    side = np.where(
        (membership("leg") > 0.0) & (at_rest[:, 1] > space.base.joints[_LEFT_KNEE, 1]), np.sign(at_rest[:, 0]), 0
    )
    short = np.maximum(_THIGH_GAP_M - side * local[:, 0], 0.0) * side
    parted: FloatArray = vertices + np.outer(short, rotation[0][:, 0])
    return parted


def to_bind_pose(
    space: ShapeSpace, fit: Fit, stands: Stance, posed: FloatArray, vertices: FloatArray
) -> tuple[Avatar, int]:
    """Carry the displaced vertices back to the bind pose, and repair tangled faces in both poses.

    Args:
        space: The shape space.
        fit: Pose and shape of the body before its displacement.
        stands: The skeleton at rest that the body shall have.
        posed: The body before its displacement [m], shape (V, 3).
        vertices: The displaced body.

    Returns:
        The body, and how many faces are still tangled in either pose.
    """
    base, faces = space.base, space.base.faces
    turn, place = skin_transforms(base.weights, base.joint_names, stands.joints, base.parents, stands.pose)
    place = place + stands.translation

    def at_rest(points: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.solve(turn, (points - place)[..., None])[..., 0], dtype=np.float64)

    straight = at_rest(posed)
    for _ in range(_MENDING_ROUNDS):
        vertices, bad = untangle_displacement(posed, vertices, faces)
        bind = at_rest(vertices)
        mended, bad_bind = untangle_displacement(straight, bind, faces)
        vertices = np.einsum("vab,vb->va", turn, mended) + place
        if np.array_equal(mended, bind):
            break
    floor = np.array([0.0, mended[:, 1].min(), 0.0])
    body = replace(
        base,
        bind_vertices=mended - floor,
        joints=stands.joints - floor,
        parameters=dict(zip(space.names, fit.parameters.tolist(), strict=True)),
    )
    return pose_avatar(body, stands.pose, stands.translation + floor), bad + bad_bind
