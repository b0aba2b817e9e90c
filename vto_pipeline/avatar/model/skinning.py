"""Skinning: what the joints do to each vertex.

Within the trunk with its legs, and within each arm, motions are blended as dual quaternions: a bent knee keeps its
volume. Between trunk and arm they are blended linearly, since dual quaternions take skin about the shoulder in an arc:
a raised arm then bulges at its armpit, where skin is taut. What the arm is turned about its own axis is spread along
the way before, so that the shoulder is not wrung (Kavan and Sorkine 2012, "Elasticity-inspired deformers": twist by
rotations, swing linearly). As an arm is raised, its share of the skin grows evenly over all of the way, where it is
steep in the middle while arms hang: skin is drawn from farther away, and an armpit that opens needs no crease.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.template.implicit import smoothstep, unsmoothed
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.numerics.kinematics import matrix_quaternions, quaternion_matrices

_ARM = ("shoulder", "elbow", "wrist")
_LEAST_BELOW = 0.1  # sine of the angle below level at which arms of a bind pose are taken to hang at least


def joint_transforms(joints: FloatArray, parents: np.ndarray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what each joint does to the bind pose, x -> R x + t, shapes (J, 3, 3) and (J, 3). Parents come first."""
    local = Rotation.from_rotvec(np.array(pose, dtype=float)).as_matrix()  # a copy: it refuses read-only arrays
    rotation, offset = np.empty_like(local), np.empty((len(joints), 3))
    for j, parent in enumerate(parents):
        if parent < 0:
            rotation[j], anchor = local[j], joints[j]
        else:
            rotation[j] = rotation[parent] @ local[j]
            anchor = rotation[parent] @ joints[j] + offset[parent]
        offset[j] = anchor - rotation[j] @ joints[j]
    return rotation, offset


def skin_transforms(
    weights: FloatArray, names: Sequence[str], joints: FloatArray, parents: np.ndarray, pose: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what happens to each vertex, x -> A x + t, shapes (V, 3, 3) and (V, 3); rigid but between trunk and arms.

    Args:
        weights: Shape (V, J).
        names: Of the joints, "left_elbow" and such.
        joints: In the bind pose [m], shape (J, 3).
        parents: Of the joints, -1 for the root, shape (J,).
        pose: Rotation vector of each joint in its parent's frame [rad], shape (J, 3).
    """
    arms = [np.array([names.index(f"{side}_{joint}") for joint in _ARM]) for side in ("left", "right")]
    twists, joints, pose = _untwisted(arms, joints, pose)
    rotation, offset = joint_transforms(joints, parents, pose)

    def part(members: NDArray[np.int_]) -> tuple[NDArray[np.int_], FloatArray, FloatArray]:
        some = np.flatnonzero(weights @ np.isin(np.arange(len(names)), members))
        return some, *blend_transforms(weights[np.ix_(some, members)], rotation[members], offset[members])

    on_trunk = np.ones(len(weights))
    moved = []
    for arm in arms:
        some, turn, place = part(arm)
        share = weights[np.ix_(some, arm)].sum(axis=1)
        share += _raised(arm, joints, parents, pose) * (unsmoothed(np.minimum(share, 1.0)) - share)
        on_trunk[some] -= share
        moved.append((some, share[:, None, None] * turn, share[:, None] * place, share))
    some, one, there = part(np.setdiff1d(np.arange(len(names)), arms))
    turn, place = np.zeros((len(weights), 3, 3)), np.zeros((len(weights), 3))
    turn[some], place[some] = on_trunk[some, None, None] * one, on_trunk[some, None] * there
    for arm, (some, one, there, share), twist in zip(arms, moved, twists, strict=True):
        spun = Rotation.from_rotvec(np.outer(share, twist)).as_matrix()
        shoulder = joints[arm[0]]
        whole = turn[some] + one
        place[some] += there + (whole @ (shoulder - spun @ shoulder)[..., None])[..., 0]
        turn[some] = whole @ spun
    return turn, place


def _raised(arm: NDArray[np.int_], joints: FloatArray, parents: np.ndarray, pose: FloatArray) -> float:
    """Return how far an arm is raised in its trunk: 0 as in the bind pose or below, 1 level or above."""
    axis = joints[arm[1]] - joints[arm[0]]
    axis /= np.linalg.norm(axis)
    held = Rotation.from_rotvec(pose[parents[arm[0]]]) * Rotation.from_rotvec(pose[arm[0]])
    return float(smoothstep(np.clip(1.0 - held.apply(axis)[1] / min(axis[1], -_LEAST_BELOW), 0.0, 1.0)))


def _untwisted(
    arms: Sequence[NDArray[np.int_]], joints: FloatArray, pose: FloatArray
) -> tuple[list[FloatArray], FloatArray, FloatArray]:
    """Return how each arm is turned about its axis at the shoulder [rad], and joints and pose of arms so turned.

    An arm that is turned in the bind pose, and then swung, goes where the pose has it.
    """
    twists, joints, pose = [], np.array(joints, dtype=float), np.array(pose, dtype=float)
    for shoulder, *below in arms:
        axis = joints[below[0]] - joints[shoulder]
        axis /= np.linalg.norm(axis)
        whole = Rotation.from_rotvec(pose[shoulder])
        *vector, real = whole.as_quat()
        along = vector @ axis
        twist = 2.0 * np.arctan2(along * np.copysign(1.0, real), abs(real)) * axis
        spin = Rotation.from_rotvec(twist)
        pose[shoulder] = (whole * spin.inv()).as_rotvec()
        pose[below] = spin.apply(pose[below])
        joints[below] = joints[shoulder] + spin.apply(joints[below] - joints[shoulder])
        twists.append(twist)
    return twists, joints, pose


def blend_transforms(weights: FloatArray, rotation: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what happens to each vertex, x -> R x + t, shapes (..., V, 3, 3) and (..., V, 3): always a rigid motion.

    Dual quaternion linear blending (Kavan et al. 2007, eq. 18); weights need not sum to 1.

    Args:
        weights: Shape (V, J).
        rotation: Of the joints, of one pose or of many, shape (..., J, 3, 3).
        offset: Of the joints [m], shape (..., J, 3).
    """
    real = matrix_quaternions(rotation)
    x, y, z, w = np.moveaxis(real, -1, 0)
    tx, ty, tz = np.moveaxis(offset, -1, 0)
    dual = np.stack(  # half of translation times rotation
        [
            tx * w + ty * z - tz * y,
            ty * w + tz * x - tx * z,
            tz * w + tx * y - ty * x,
            -tx * x - ty * y - tz * z,
        ],
        axis=-1,
    )
    # q and -q are one rotation: take those that lie on the side of the vertex's main joint
    side = np.where(real @ np.swapaxes(real, -1, -2) < 0, -1.0, 1.0)
    shares = weights * side[..., np.argmax(weights, axis=1), :]
    mixed, moved = shares @ real, shares @ dual
    length = np.linalg.norm(mixed, axis=-1, keepdims=True)
    mixed, moved = mixed / length, moved / length
    v, s, d, e = mixed[..., :3], mixed[..., 3:], moved[..., :3], moved[..., 3:]
    return quaternion_matrices(mixed), s * d - e * v + np.cross(v, d)


def linear_blend_skinning(
    vertices: FloatArray, weights: FloatArray, rotation: FloatArray, offset: FloatArray
) -> FloatArray:
    """Return the vertices moved by the linear blend of their joints (Magnenat-Thalmann et al. 1988), shape (V, 3).

    Its derivative is simple: it serves where a pose is searched for.
    """
    blended = (weights @ rotation.reshape(len(rotation), 9)).reshape(-1, 3, 3)
    return np.einsum("vij,vj->vi", blended, vertices) + weights @ offset
