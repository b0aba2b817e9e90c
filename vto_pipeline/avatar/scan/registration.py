"""Registration of pose and shape to a scan: Gauss-Newton on closest points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import compose_pose, parent_rotations
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.scan.correspondence import Correspondences
from vto_pipeline.avatar.scan.initial_pose import InitialPose
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.model.arrays import FloatArray, IntArray

_POSE_SIGMA_RAD = {
    "spine": 0.12,
    "chest": 0.12,
    "neck": 0.08,
    "head": 0.08,
    "clavicle": 0.12,
    "shoulder": 0.50,
    "elbow": 0.35,
    "wrist": 0.10,
    "hip": 0.25,
    "knee": 0.15,
    "ankle": 0.15,
}
_INDEPENDENT = 400.0
_MAX_TURN_RAD = 0.4


def initial_fit(space: ShapeSpace, start: InitialPose, pose: FloatArray) -> Fit:
    """Turn a first guess into parameters: the size stretches every segment alike."""
    parameters = np.zeros(len(space.names))
    for k, name in enumerate(space.names):
        if name.endswith(("_height", "_length", "_breadth", "_depth", "_girth", "_scale")) and not name.startswith(
            "foot_breadth"
        ):
            parameters[k] = start.scale - 1
    pose = pose.copy()
    pose[0] = [0.0, start.yaw, 0.0]
    pelvis = space.joints(parameters)[0]
    turn = Rotation.from_rotvec(pose[0]).as_matrix()
    # the guess turns about the origin, the skeleton about the pelvis
    return Fit(parameters, pose, start.translation + turn @ pelvis - pelvis, parameters)


def refine_registration(space: ShapeSpace, fit: Fit, pairs: Correspondences, noise: float, stiff: float = 1.0) -> Fit:
    """Take one Gauss-Newton step.

    Args:
        space: The shape space.
        fit: Where to step from.
        pairs: Point-to-plane correspondences.
        noise: Spread of the distances [m]: how much the pairs count against the prior.
        stiff: How much more than it should the shape is drawn to the expected one.
    """
    normal, right, above = _system(space, fit, pairs, noise, stiff)
    joints, count = len(space.base.joints), len(space.names)
    move = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
    turn = move[count : count + 3 * joints].reshape(-1, 3)
    turn *= min(1.0, _MAX_TURN_RAD / max(np.abs(turn).max(), 1e-12))
    return replace(
        fit,
        parameters=fit.parameters + move[:count],
        pose=compose_pose(fit.pose, turn, above),
        translation=fit.translation + move[-3:],
    )


def covariance(space: ShapeSpace, fit: Fit, pairs: Correspondences, noise: float) -> FloatArray:
    """Return how surely the shape's parameters are known after the fit, pose and place left open too, shape (P, P)."""
    count = len(space.names)
    whole = np.linalg.inv(_system(space, fit, pairs, noise, 1.0)[0])
    found: FloatArray = whole[:count, :count].astype(np.float64)
    return found


def _system(
    space: ShapeSpace, fit: Fit, pairs: Correspondences, noise: float, stiff: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the normal equations of a step, and the rotation of each joint's parent, shape (J, 3, 3)."""
    pairs = pairs.weighted()
    vertices = posed_vertices(space, fit)
    points = np.einsum("nk,nkd->nd", pairs.shares, vertices[pairs.corners])
    wrong = ((points - pairs.targets) * pairs.normals).sum(axis=1)
    joints = len(space.base.joints)
    count = len(space.names)
    # neighbouring points err together: all of them count as a few hundred independent ones
    weight = np.sqrt(pairs.weights * _INDEPENDENT / max(len(wrong), 1)) / noise
    sigma = np.array([_POSE_SIGMA_RAD.get(kind, 10.0) for kind in JOINT_KINDS])
    prior = np.zeros((count + 3 * joints, count + 3 * joints + 3))
    prior[:count, :count] = stiff * space.whitener
    prior[count:, count : count + 3 * joints] = np.diag(np.repeat(1 / sigma, 3))
    rotation, _ = joint_transforms(space.joints(fit.parameters), space.base.parents, fit.pose)
    above = parent_rotations(rotation, space.base.parents)
    # the joints turn in world axes: so must the pose that is drawn to zero
    bent = np.einsum("jab,jb->ja", above, fit.pose)
    straight = np.concatenate(
        [stiff * space.whitener @ (fit.parameters - fit.expected), (bent / sigma[:, None]).ravel()]
    )
    slope = derivatives(space, fit, pairs) * weight[:, None]
    normal = slope.T @ slope + prior.T @ prior
    right = -slope.T @ (wrong * weight) - prior.T @ straight
    return normal + 1e-9 * np.eye(len(normal)), right, above


def derivatives(space: ShapeSpace, fit: Fit, pairs: Correspondences) -> FloatArray:
    """Derivative of each pair's distance by shape, joint turns in world axes, translation: (N, P + 3 J + 3)."""
    base = space.base
    joints = space.joints(fit.parameters)
    rotation, offset = joint_transforms(joints, base.parents, fit.pose)
    used, where = np.unique(pairs.corners, return_inverse=True)
    where = where.reshape(pairs.corners.shape)
    weights, bind = base.weights[used], space.vertices(fit.parameters)[used]
    blended = (weights @ rotation.reshape(len(rotation), 9)).reshape(-1, 3, 3)
    # shape: the bind pose moves, and the joints about which it is turned
    moved = np.zeros_like(space.joint_fields)
    for j, parent in enumerate(base.parents):
        own = space.joint_fields[:, j]
        moved[:, j] = (
            own if parent < 0 else moved[:, parent] + (own - space.joint_fields[:, parent]) @ rotation[parent].T
        )
    carried = moved - np.einsum("jab,pjb->pja", rotation, space.joint_fields)
    fields = np.ascontiguousarray(space.fields[:, used].transpose(1, 2, 0))
    by_shape = blended @ fields + np.tensordot(weights, carried, axes=(1, 1)).swapaxes(1, 2)
    # pose: everything beyond a joint turns about the joint's place
    each = np.einsum("jab,vb->vja", rotation, bind) + offset
    place = np.einsum("jab,jb->ja", rotation, joints) + offset
    beyond = _descendants(base.parents)
    weighted = np.tensordot(weights[:, :, None] * each, beyond, axes=(1, 0)).swapaxes(1, 2)
    lever = weighted - (weights @ beyond)[:, :, None] * place
    out = np.zeros((len(pairs.weights), len(space.names) + 3 * len(joints) + 3))
    for corner in range(3):
        share, row = pairs.shares[:, corner, None], where[:, corner]
        out[:, : len(space.names)] += share * (pairs.normals[:, None] @ by_shape[row])[:, 0]
        out[:, len(space.names) : -3] += share * np.cross(lever[row], pairs.normals[:, None]).reshape(len(row), -1)
    out[:, -3:] = pairs.normals
    return out


def _descendants(parents: IntArray) -> FloatArray:
    """1 where joint j lies at or beyond joint k, shape (J, J)."""
    beyond = np.eye(len(parents))
    for j, parent in enumerate(parents):
        if parent >= 0:
            beyond[j] = np.maximum(beyond[j], beyond[parent])
            beyond[j, j] = 1.0
    return beyond
