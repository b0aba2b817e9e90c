"""Fit of shape, poses and cameras to two outlines: Gauss-Newton on both at once.

The person may have moved between the pictures: each view has its own pose, place and camera; the shape is shared. What
the outlines leave open the population fills in (Boisvert et al. 2013 do the same with another model).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.population import Population
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import compose_pose, parent_rotations
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.scan.correspondence import Correspondences, geman_mcclure
from vto_pipeline.avatar.scan.registration import derivatives
from vto_pipeline.avatar.silhouettes.outline import Camera, ImageOutline, model_outline
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar

_POSE_SIGMA_RAD = {
    "pelvis": (0.05, 0.10, 0.03),
    "spine": (0.05, 0.05, 0.03),
    "chest": (0.05, 0.05, 0.03),
    "neck": (0.10, 0.10, 0.05),
    "head": (0.10, 0.10, 0.05),
    "clavicle": (0.10, 0.10, 0.10),
    "shoulder": (0.40, 0.40, 0.40),
    "elbow": (0.20, 0.20, 0.20),
    "wrist": (0.20, 0.20, 0.20),
    "hip": (0.05, 0.12, 0.12),
    "knee": (0.05, 0.05, 0.03),
    "ankle": (0.08, 0.15, 0.08),
}
"""Of a person who stands straight: bent forwards, turned about the vertical, bent sideways, in the parent's frame.

The pelvis stands for the whole body: how far the camera may be tilted, the person turned, the picture askew. Legs that
swing back or forth unseen would make the body shorter and the picture's scale too large; an elbow that may fold as it
likes passes for a bust.
"""
_STATURE_SIGMA_M = 0.003
_POSTURE = ("spine", "chest", "neck", "head", "hip", "knee")
_ALIKE_RAD = 0.02
"""How differently one person stands in both pictures, arms and feet apart: one view shows what the other hides."""
_FLAT_RAD = 0.02
"""How far a foot may be tipped against the upright.

A toe that dips makes the body taller than its stature, and its picture's scale wrong by some percent.
"""
_DROP_SHARE = 0.10
"""Of the picture's height: how far its middle may be from where the lens looks. Few photos are cropped evenly."""
_SAME_TILT_RAD, _SAME_DISTANCE, _SAME_FOCAL, _SAME_DROP = 0.006, 0.01, 0.003, 0.006
"""How differently one camera took both pictures of one size: the person turned, it did not. Shares but for the tilt.

A tilt that the outlines of one view would suffer makes the body lean, and its picture's scale wrong by some percent.
"""
_DISTANCE_SPREAD = 0.08
"""Relative. How strongly a picture converges depends on the distance so little that any misfit would settle it."""
_EYE_SPREAD_M = 0.25
"""How far the lens may be from where it is expected to be held, between a hip's height and an eye's.

How high it is shows in feet and crown alone, which no model has quite right; and a lens too low makes the nearer foot
of the side view reach less far down, the body too tall in the picture, and its picture's scale too large.
"""
_REACH_M, _LAST_REACH_M, _FALL = 0.10, 0.02, 0.85
_INDEPENDENT = 150.0
"""Points of an outline that err on their own: the model is wrong alike over some centimetres."""
_MAX_MOVE = 2.0
_CAP_M = 0.05
_NORMAL_PX = 30.0
"""A difference of one radian in direction counts as much as this distance, when outlines are matched."""


@dataclass(frozen=True)
class SilhouetteView:
    """One picture and what is assumed of it.

    Args:
        outline: Of the person.
        nominal: Nominal pose of the joints; the first is how the body stands to the camera, shape (J, 3).
        fit: Where the model stands, in the camera's frame.
        camera: Through which it is seen.
    """

    outline: ImageOutline
    nominal: FloatArray
    fit: Fit
    camera: Camera


@dataclass(frozen=True)
class Evidence:
    """Evidence other than the outlines.

    Args:
        population: Of the measurements.
        tape: Reads them.
        stature: [m].
        distance: Of the camera, expected [m].
        eye: Height of the lens above the floor, expected [m].
    """

    population: Population
    tape: Tape
    stature: float
    distance: float
    eye: float


@dataclass(frozen=True)
class Solution:
    """The state of the fit.

    Args:
        views: Front and side.
        parameters: Of the shape, shape (P,).
        covariance: Of the parameters, shape (P, P).
        outline_errors: Mean distance between the outlines before the step, per view, far points cut off [m].
        misfit: Before the step: twice the negative logarithm of the likelihood with its prior, but for a constant.
    """

    views: tuple[SilhouetteView, ...]
    parameters: FloatArray
    covariance: FloatArray
    outline_errors: tuple[float, ...]
    misfit: float


def gauss_newton_step(
    space: ShapeSpace,
    views: tuple[SilhouetteView, ...],
    evidence: Evidence,
    trust: FloatArray,
    reach: float,
    noise: float,
    stiff: float = 1.0,
) -> Solution:
    """Take one Gauss-Newton step over the shape and every view's pose, place and focal length.

    Args:
        space: The shape space.
        views: Where to step from; all share their parameters.
        evidence: Beside the outlines.
        trust: How much each vertex counts, shape (V,).
        reach: Distance at which a point begins to count little [m].
        noise: Spread of an outline's distance [m].
        stiff: How much more than it should the shape is drawn to the usual one.
    """
    count, joints = len(space.names), len(space.base.joints)
    block = 3 * joints + 5
    size = count + block * len(views)
    normal, right = np.zeros((size, size)), np.zeros(size)
    wrong, misfit = [], 2 * float(np.log(np.diag(np.linalg.cholesky(evidence.population.covariance))).sum())
    for k, view in enumerate(views):
        slope, off, weight, apart = _rows(space, view, trust, reach)
        wrong.append(apart)
        scale = np.sqrt(weight * _INDEPENDENT / weight.sum()) / noise
        own, offs = _pose_prior(space, view, evidence)
        place = np.r_[0:count, count + k * block : count + (k + 1) * block]
        slope, off = slope * scale[:, None], off * scale
        normal[np.ix_(place, place)] += slope.T @ slope
        right[place] -= slope.T @ off
        place = place[count:]
        normal[np.ix_(place, place)] += own.T @ own
        right[place] -= own.T @ offs
        misfit += float(off @ off + offs @ offs)
    parameters = views[0].fit.parameters
    usual = space.whitener @ (parameters - views[0].fit.expected)
    if len(views) == 2:
        together = [_posture_rows(space, *views)]
        if (views[0].camera.width, views[0].camera.height) == (views[1].camera.width, views[1].camera.height):
            together.append(_camera_rows(*views))
        for own, offs in together:
            normal[count:, count:] += own.T @ own
            right[count:] -= own.T @ offs
            misfit += float(offs @ offs)
    for slope, off in (_tape_rows(space, parameters, evidence), (space.whitener, usual)):
        normal[:count, :count] += stiff**2 * slope.T @ slope
        right[:count] -= stiff**2 * slope.T @ off
        misfit += stiff**2 * float(off @ off)
    normal += 1e-9 * np.eye(size)
    move: FloatArray = np.linalg.solve(normal, right).astype(np.float64)
    move *= min(
        1.0, _MAX_MOVE / np.abs(move[:count] / space.sigmas).max(), 0.4 / np.abs(_turns(move, count, block)).max()
    )
    parameters = parameters + move[:count]
    moved = tuple(
        _moved(space, view, parameters, move[count + k * block : count + (k + 1) * block])
        for k, view in enumerate(views)
    )
    return Solution(moved, parameters, np.linalg.inv(normal)[:count, :count].astype(np.float64), tuple(wrong), misfit)


def run_steps(
    space: ShapeSpace,
    views: tuple[SilhouetteView, ...],
    evidence: Evidence,
    trust: FloatArray,
    noise: float,
    steps: int,
    stiff: float = 1.0,
    begun: int = 0,
) -> Solution:
    """Take some steps as `gauss_newton_step` does, each with a smaller reach; `begun` were taken before."""
    for k in range(begun, begun + steps):
        reach = max(_REACH_M * _FALL**k, _LAST_REACH_M)
        solution = gauss_newton_step(space, views, evidence, trust, reach, noise, stiff)
        views = solution.views
    return solution


def _turns(move: FloatArray, count: int, block: int) -> FloatArray:
    return move[count:].reshape(-1, block)[:, :-5]


def _rows(
    space: ShapeSpace, view: SilhouetteView, trust: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Derivatives, distances [m], weights: the model's rim in the picture's distance field and the reverse; their mean.

    Distances count across the outline.
    """
    vertices = posed_vertices(space, view.fit)
    rim = model_outline(vertices, space.base.faces, view.camera)
    metres = -view.fit.translation[2] / view.camera.focal
    value, ahead = view.outline.distance(rim.at)
    agree = (ahead * rim.normals).sum(axis=1) > 0.5
    here = cKDTree(np.hstack([rim.at, _NORMAL_PX * rim.normals]))
    seen, seen_normals = view.outline.points, view.outline.normals
    _, nearest = here.query(np.hstack([seen, _NORMAL_PX * seen_normals]))
    back = ((rim.at[nearest] - seen) * seen_normals).sum(axis=1)
    away = np.linalg.norm(rim.at[nearest] - seen, axis=1) * metres
    apart = (np.minimum(np.abs(value) * metres, _CAP_M).mean() + np.minimum(away, _CAP_M).mean()) / 2
    fits = (seen_normals * rim.normals[nearest]).sum(axis=1) > 0.5
    edges = np.concatenate([rim.edges, rim.edges[nearest]]).astype(np.int64)
    normals = np.concatenate([ahead, seen_normals])
    off = np.concatenate([value, back]) * metres
    middle = vertices[edges].mean(axis=1)
    weight = np.concatenate(
        [
            geman_mcclure(np.abs(value) * metres, reach) * agree / max(len(value), 1),
            geman_mcclure(away, reach) * fits / max(len(back), 1),
        ]
    ) * trust[edges].mean(axis=1)
    corners = np.concatenate([edges, edges[:, :1]], axis=1)
    shares = np.tile([0.5, 0.5, 0.0], (len(edges), 1))
    kept = weight > 1e-9
    corners, shares, middle, normals, off, weight = (x[kept] for x in (corners, shares, middle, normals, off, weight))
    directions = view.camera.pull_back(middle, normals) * metres
    slope = derivatives(space, view.fit, Correspondences(corners, shares, middle, directions, weight))
    by_focal = ((view.camera.project(middle) - view.camera.middle) * normals).sum(axis=1) * metres
    return np.hstack([slope, by_focal[:, None], (normals[:, 1] * metres)[:, None]]), off, weight, float(apart)


def _pose_prior(space: ShapeSpace, view: SilhouetteView, evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    """Rows that draw the pose to the nominal one, the feet flat and the camera to where it is expected."""
    base = space.base
    joints = len(base.joints)
    sigmas = np.array([_POSE_SIGMA_RAD[kind] for kind in JOINT_KINDS])
    rotation, _ = joint_transforms(space.joints(view.fit.parameters), base.parents, view.fit.pose)
    above = parent_rotations(rotation, base.parents)
    turned = Rotation.from_rotvec(view.fit.pose.copy()) * Rotation.from_rotvec(view.nominal.copy()).inv()
    rows = np.zeros((3 * joints + 2, 3 * joints + 5))
    # the joints turn in world axes, they are bent in their parents'
    rows[: 3 * joints, : 3 * joints] = block_diag(*(above.swapaxes(1, 2) / sigmas[:, :, None]))
    distance = -view.fit.translation[2]
    rows[-2, -3] = -1 / (distance * _DISTANCE_SPREAD)
    off = np.log(distance / evidence.distance) / _DISTANCE_SPREAD
    rows[-1, -1] = 1 / (_DROP_SHARE * view.camera.height)
    flat, tipped = _feet_rows(base, rotation)
    flat = np.hstack([flat, np.zeros((len(flat), 5))])
    held, height = _eye_row(space.joints(view.fit.parameters)[0], rotation[0], view.fit)
    offs = [
        (turned.as_rotvec() / sigmas).ravel(),
        [off, rows[-1, -1] * view.camera.drop],
        tipped,
        [(height - evidence.eye) / _EYE_SPREAD_M],
    ]
    return np.vstack([rows, flat, held / _EYE_SPREAD_M]), np.concatenate(offs)


def _eye_row(pelvis: FloatArray, rotation: FloatArray, fit: Fit) -> tuple[FloatArray, float]:
    """Height of the lens above the floor the body stands on [m], and its derivative by turns, place and camera.

    Args:
        pelvis: At rest, where the floor is y = 0, shape (3,).
        rotation: Of the posed pelvis, shape (3, 3).
        fit: Of the view.
    """
    up, place = rotation[:, 1], pelvis + fit.translation
    row = np.zeros(fit.pose.size + 5)
    row[:3] = np.cross(place, up)
    row[-5:-2] = -up
    return row, float(pelvis[1] - up @ place)


def _feet_rows(base: Avatar, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows that keep the soles flat on the floor; the toes may point anywhere.

    Args:
        base: The joints' names and parents.
        rotation: Of the posed joints, shape (J, 3, 3).
    """
    rows, off = [], []
    for side in ("left", "right"):
        joint = foot = base.joint_names.index(f"{side}_ankle")
        row = np.zeros((3, len(rotation), 3))
        while joint != 0:
            row[:, joint] = rotation[0].T / _FLAT_RAD  # turns are in world axes, tipping in the body's
            joint = int(base.parents[joint])
        tipped = Rotation.from_matrix(rotation[0].T @ rotation[foot]).as_rotvec() / _FLAT_RAD
        rows.append(row.reshape(3, -1)[[0, 2]])
        off.append(tipped[[0, 2]])
    return np.vstack(rows), np.concatenate(off)


def _posture_rows(space: ShapeSpace, front: SilhouetteView, side: SilhouetteView) -> tuple[FloatArray, FloatArray]:
    """Rows that draw the posture of trunk and legs in one view to that in the other."""
    base = space.base
    joints = space.joints(front.fit.parameters)
    own = np.isin(JOINT_KINDS, _POSTURE)
    rows, size = [], 3 * len(joints)
    for view, sign in ((front, 1.0), (side, -1.0)):
        rotation, _ = joint_transforms(joints, base.parents, view.fit.pose)
        above = np.stack([rotation[max(parent, 0)] for parent in base.parents])
        turns = sign / _ALIKE_RAD * block_diag(*above.swapaxes(1, 2))
        rows.append(np.hstack([turns, np.zeros((size, 5))])[np.repeat(own, 3)])
    apart = Rotation.from_rotvec(front.fit.pose.copy()) * Rotation.from_rotvec(side.fit.pose.copy()).inv()
    return np.hstack(rows), (apart.as_rotvec()[own] / _ALIKE_RAD).ravel()


def _camera_rows(front: SilhouetteView, side: SilhouetteView) -> tuple[FloatArray, FloatArray]:
    """Rows that draw tilt, distance, focal length and middle of one camera to the other's: only the person turned."""
    turned = [
        Rotation.from_rotvec(view.fit.pose[0].copy()) * Rotation.from_rotvec(view.nominal[0].copy()).inv()
        for view in (front, side)
    ]
    size = front.fit.pose.size + 5
    away = [-view.fit.translation[2] for view in (front, side)]
    sigmas = np.array([_SAME_TILT_RAD, _SAME_DISTANCE, _SAME_FOCAL, _SAME_DROP * front.camera.height])
    rows = np.zeros((4, 2 * size))
    for k, (start, sign) in enumerate(((0, 1.0), (size, -1.0))):
        rows[0, start] = sign
        rows[1, start + size - 3] = -sign / away[k]
        rows[2, start + size - 2] = sign
        rows[3, start + size - 1] = sign
    off = np.array(
        [
            turned[0].as_rotvec()[0] - turned[1].as_rotvec()[0],
            np.log(away[0] / away[1]),
            np.log(front.camera.focal / side.camera.focal),
            front.camera.drop - side.camera.drop,
        ]
    )
    return rows / sigmas[:, None], off / sigmas


def _tape_rows(space: ShapeSpace, parameters: FloatArray, evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    """Rows that draw the measurements to the population's, and the stature to the one given."""
    vertices = space.vertices(parameters)
    readings = [evidence.tape.read(DEFINITIONS[name], vertices) for name in evidence.population.names]
    slope = np.array([reading.by_parameters(space.fields) for reading in readings])
    value = np.array([reading.value for reading in readings])
    whiten = np.linalg.inv(np.linalg.cholesky(evidence.population.covariance))
    tall = evidence.population.names.index("stature")
    return (
        np.vstack([whiten @ slope, slope[tall] / _STATURE_SIGMA_M]),
        np.append(whiten @ (value - evidence.population.mean), (value[tall] - evidence.stature) / _STATURE_SIGMA_M),
    )


def _moved(space: ShapeSpace, view: SilhouetteView, parameters: FloatArray, move: FloatArray) -> SilhouetteView:
    base = space.base
    rotation, _ = joint_transforms(space.joints(view.fit.parameters), base.parents, view.fit.pose)
    turn = move[:-5].reshape(-1, 3)
    pose = compose_pose(view.fit.pose, turn, parent_rotations(rotation, base.parents))
    fit = replace(view.fit, parameters=parameters, pose=pose, translation=view.fit.translation + move[-5:-2])
    camera = replace(
        view.camera, focal=view.camera.focal * float(np.exp(move[-2])), drop=view.camera.drop + float(move[-1])
    )
    return replace(view, fit=fit, camera=camera)
