"""Initial pose of a person in two pictures: arms and visible side, starting from the mean body."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.model.fit import Fit
from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.model.shape import ShapeSpace
from vto_pipeline.avatar.model.skinning import joint_transforms
from vto_pipeline.avatar.scan.initial_pose import InitialPose
from vto_pipeline.avatar.scan.registration import initial_fit
from vto_pipeline.avatar.silhouettes.fit import Evidence, SilhouetteView, Solution, run_steps
from vto_pipeline.avatar.silhouettes.outline import Camera, ImageOutline
from vto_pipeline.avatar.template.implicit import arm_axis
from vto_pipeline.model.arrays import FloatArray

_TRIAL_STEPS, _MORE_STEPS, _FINALISTS = 3, 4, 2
"""Steps of every guess, and how many more of how many of the best."""
_STIFF = 4.0
_POSES = ("a_pose", "arms_down", "t_pose")
_ARMS_AHEAD_RAD = ((-0.5, 0.0), (-0.2, 0.0), (0.15, 0.0), (0.5, 0.0), (0.0, 0.6))
"""Swing of the shoulders, bend of the elbows: how the arms may be held in the side view."""


def initial_views(
    space: ShapeSpace, front: NDArray[np.bool_], side: NDArray[np.bool_], evidence: Evidence, noise: float
) -> Solution:
    """Estimate the person's pose in both views.

    Args:
        space: The shape space.
        front: Where the person is in the front picture, shape (H, W).
        side: The same in the side picture.
        evidence: Beside the outlines.
        noise: Spread of an outline's distance [m].
    """
    ahead, across = ImageOutline(front), ImageOutline(side)
    facing = _best_guess(
        space,
        [(_place(space, ahead, front, 0.0, named_pose(space.base, name).pose, evidence),) for name in _POSES],
        evidence,
        noise,
    ).views[0]
    return _best_guess(
        space,
        [
            (facing, _place(space, across, side, yaw, _arms_ahead(space, facing, *angles), evidence))
            for yaw in (np.pi / 2, -np.pi / 2)
            for angles in _ARMS_AHEAD_RAD
        ],
        evidence,
        noise,
    )


def mean_body(space: ShapeSpace, stature: float, yaw: float, pose: FloatArray) -> Fit:
    """Return the mean body, scaled to a stature [m], turned and posed, at the origin."""
    scale = stature / float(np.ptp(space.base.bind_vertices[:, 1]))
    return initial_fit(space, InitialPose(yaw, scale, np.zeros(3), "", 0.0), pose)


def _best_guess(
    space: ShapeSpace, guesses: Iterable[tuple[SilhouetteView, ...]], evidence: Evidence, noise: float
) -> Solution:
    """Return the result of the best guess."""
    everywhere = np.ones(len(space.base.vertices))

    def some(guesses: Iterable[tuple[SilhouetteView, ...]], begun: int, steps: int) -> list[Solution]:
        # a hand held before the belly must not pass for a belly: the arms are found while the shape is stiff
        found = [run_steps(space, views, evidence, everywhere, noise, steps, _STIFF, begun) for views in guesses]
        return sorted(found, key=lambda solution: sum(solution.outline_errors))

    first = some(guesses, 0, _TRIAL_STEPS)[:_FINALISTS]
    return some([solution.views for solution in first], _TRIAL_STEPS, _MORE_STEPS)[0]


def _arms_ahead(space: ShapeSpace, facing: SilhouetteView, swing: float, bend: float) -> FloatArray:
    """Return the front view's pose, legs and arms apart as they are seen there, arms swung forward and bent [rad].

    What the front does not show, whether an arm is held forward or back, is not taken from there.
    """
    joints, names, pose = space.joints(facing.fit.parameters), space.base.joint_names, facing.nominal.copy()
    for k, name in enumerate(names):
        if name.endswith(("hip", "ankle")):
            pose[k] = facing.fit.pose[k]
    rotation, offset = joint_transforms(joints, space.base.parents, facing.fit.pose)
    x, y, _ = arm_axis()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, wrist = (names.index(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist"))
        arm = np.subtract(*(rotation[j] @ joints[j] + offset[j] for j in (wrist, shoulder)))
        raised = Rotation.from_rotvec([0.0, 0.0, sign * (np.arctan2(arm[1], sign * arm[0]) - np.arctan2(y, x))])
        pose[shoulder] = (Rotation.from_rotvec([-swing, 0.0, 0.0]) * raised).as_rotvec()
        pose[elbow] = bend * np.array([y, -sign * x, 0.0])
    return pose


def _place(
    space: ShapeSpace, outline: ImageOutline, mask: NDArray[np.bool_], yaw: float, pose: FloatArray, evidence: Evidence
) -> SilhouetteView:
    """Place the mean body, scaled to the stature, behind an outline; the lens level and as high as expected."""
    rows, columns = np.nonzero(mask)
    height, width = mask.shape
    focal = (rows.max() + 1 - rows.min()) * evidence.distance / evidence.stature
    level = rows.max() + 0.5 - evidence.eye * focal / evidence.distance
    camera = Camera(focal, width, height, level - (height - 1) / 2)
    fit = mean_body(space, evidence.stature, yaw, pose)
    metres = evidence.distance / camera.focal
    middle = np.array([np.median(columns), rows.max() + 0.5]) - camera.middle
    place = np.array([middle[0] * metres, -middle[1] * metres, -evidence.distance])
    return SilhouetteView(outline, fit.pose, replace(fit, translation=fit.translation + place), camera)
