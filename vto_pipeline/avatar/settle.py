"""Carry a displaced body back to the bind pose, sound in both poses: no face turned over, none through another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.avatar.displacement import untangle
from vto_pipeline.avatar.pose import joint_transforms, pose_avatar
from vto_pipeline.avatar.registration import Fit
from vto_pipeline.avatar.shape import ShapeSpace
from vto_pipeline.avatar.template import JOINTS, membership
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

_SETTLE_ROUNDS = 3
_THIGH_GAP_M = 0.001
_LEFT_KNEE = JOINTS.index("left_knee")


def part_thighs(space: ShapeSpace, fit: Fit, vertices: FloatArray) -> FloatArray:
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


def settle(space: ShapeSpace, fit: Fit, posed: FloatArray, vertices: FloatArray) -> tuple[Avatar, int]:
    """Carry the displaced vertices back to the bind pose, and mend tangled faces in both poses.

    Returns:
        The body, and how many faces are still tangled in either pose.
    """
    faces, weights = space.base.faces, space.base.weights
    joints, straight = space.joints(fit.parameters), space.vertices(fit.parameters)
    rotation, offset = joint_transforms(joints, space.base.parents, fit.pose)
    blended = (weights @ rotation.reshape(len(rotation), 9)).reshape(-1, 3, 3)
    place = weights @ offset + fit.translation
    for _ in range(_SETTLE_ROUNDS):
        vertices, bad = untangle(posed, vertices, faces)
        bind: FloatArray = np.linalg.solve(blended, (vertices - place)[:, :, None])[:, :, 0].astype(np.float64)
        mended, bad_bind = untangle(straight, bind, faces)
        vertices = np.einsum("vab,vb->va", blended, mended) + place
        if np.array_equal(mended, bind):
            break
    floor = np.array([0.0, mended[:, 1].min(), 0.0])
    body = replace(
        space.base,
        bind_vertices=mended - floor,
        joints=joints - floor,
        parameters=dict(zip(space.names, fit.parameters.tolist(), strict=True)),
    )
    return pose_avatar(body, fit.pose, fit.translation + floor), bad + bad_bind
