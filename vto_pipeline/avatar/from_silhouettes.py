"""A body from a front and a side photo: shape, poses and cameras that explain both outlines, and what that leaves open.

Two outlines do not determine girths: even perfect ones leave 13 to 21 mm of mean error at chest, waist and hip. So an
interval is reported.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from vto_pipeline.avatar.backdrop import person
from vto_pipeline.avatar.definitions import DEFINITIONS
from vto_pipeline.avatar.implicit import arm_axis
from vto_pipeline.avatar.outline import Camera, ImageOutline
from vto_pipeline.avatar.population import population
from vto_pipeline.avatar.pose import named_pose
from vto_pipeline.avatar.registration import first_fit
from vto_pipeline.avatar.scan_report import ends
from vto_pipeline.avatar.scan_start import Start
from vto_pipeline.avatar.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.avatar.silhouette_fit import Evidence, Solution, View, step
from vto_pipeline.avatar.tape import Tape
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_OPEN_SHARE = {"chest_girth": 0.023, "waist_girth": 0.019, "hip_girth": 0.016}
"""Spread of a girth where its breadth and depth are known exactly, as a share of it: regressions in ANSUR II."""
_REACH_M, _LAST_REACH_M = 0.10, 0.02
_ROUGH_STEPS = 7
_STIFF = 4.0
_POSES = ("a_pose", "arms_down", "t_pose")
_ARMS_AHEAD_RAD = ((-0.2, 0.0), (0.15, 0.0), (0.5, 0.0), (0.0, 0.6))
"""Swing of the shoulders, bend of the elbows: how the arms may be held in the side view."""
_POOR_M, _BETTER = 0.012, 0.7
"""Outlines this far apart (both views together) raise the question whether the pictures are swapped."""
_ENDS_SHARE = 0.25
"""How much head, hands and feet count: hair, fingers and shoes are not modelled."""
_INDEPENDENT = 300.0


class SilhouettesConfig(Config):
    """Settings of the fit to two photos."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="whose statistics complete the body"
    )
    distance_m: float = Field(default=2.5, gt=0.5, le=20, description="from the camera to the body, about [m]")
    outline_sigma_mm: float = Field(
        default=4.0, gt=0, le=100, description="uncertainty of a point on the outline: picture, cloth, model [mm]"
    )
    iterations: int = Field(default=20, ge=5, le=200, description="Gauss-Newton steps")
    max_wrong_mm: float = Field(
        default=25.0, gt=0, description="a larger mean distance of the outlines means that this is no body [mm]"
    )


def fit_silhouettes(
    silhouettes: Silhouettes,
    front_image: ByteArray,
    side_image: ByteArray,
    config: SilhouettesConfig | None = None,
    job: Job | None = None,
) -> Avatar:
    """Return the likeliest body behind two outlines, in the bind pose.

    Args:
        silhouettes: Names of the photos, for messages, and the stature [m].
        front_image: sRGB, shape (H, W, 3): plain backdrop, the whole body, arms held off.
        side_image: The same from the side.
        config: Settings.
        job: Receives `<girth>_m` and `<girth>_interval_mm` (half the 95 % interval) for chest, waist and hip.

    Raises:
        AvatarError: no body, or no whole one, stands out from the backdrop.
    """
    config, job = config or SilhouettesConfig(), job or Job()
    front, side = person(front_image, str(silhouettes.front)), person(side_image, str(silhouettes.side))
    space = shape_space(SEX_SHARE[config.sex])
    evidence = Evidence(population(config.sex), Tape(space.base), silhouettes.stature, config.distance_m)
    job.progress(0.0, "how the person stands")
    begin = _stand(space, front, side, evidence, config)
    if sum(begin.wrong) > _POOR_M and sum(_stand(space, side, front, evidence, config).wrong) < _BETTER * sum(
        begin.wrong
    ):
        raise AvatarError(
            "the outlines fit a body better with front and side swapped",
            where=f"{silhouettes.front}, {silhouettes.side}",
            hint="the first picture is the one from the front",
        )
    job.progress(0.5, "shape, poses and cameras")
    solution = _advance(space, begin.views, evidence, 1 - (1 - _ENDS_SHARE) * ends(space), config, config.iterations)
    for name, wrong in zip(("front", "side"), solution.wrong, strict=True):
        job.measure(**{f"{name}_outline_mm": round(wrong * 1e3, 2)})
        if wrong * 1e3 > config.max_wrong_mm:
            raise AvatarError(
                f"the {name} outline lies {wrong * 1e3:.0f} mm from any body's (at most {config.max_wrong_mm:g})",
                where=str(getattr(silhouettes, name)),
                hint="tight clothes, arms held off the body, nothing else in the picture",
            )
    return _report(space, solution, job)


def _stand(
    space: ShapeSpace, front: NDArray[np.bool_], side: NDArray[np.bool_], evidence: Evidence, config: SilhouettesConfig
) -> Solution:
    """Find out how the person stands in both views: arms, and which side is seen."""

    def rough(*views: View) -> Solution:
        # a hand held before the belly must not pass for a belly: the arms are found while the shape is stiff
        return _advance(space, views, evidence, np.ones(len(space.base.vertices)), config, _ROUGH_STEPS, _STIFF)

    ahead = ImageOutline(front)
    facing = min(
        (rough(_place(space, ahead, front, 0.0, named_pose(space.base, name).pose, evidence)) for name in _POSES),
        key=lambda found: found.wrong[0],
    )
    across = ImageOutline(side)
    return min(
        (
            rough(
                facing.views[0],
                _place(space, across, side, yaw, _arms_ahead(space, facing.views[0].start, *angles), evidence),
            )
            for yaw in (np.pi / 2, -np.pi / 2)
            for angles in _ARMS_AHEAD_RAD
        ),
        key=lambda found: sum(found.wrong),
    )


def _arms_ahead(space: ShapeSpace, pose: FloatArray, swing: float, bend: float) -> FloatArray:
    """Return the pose with both arms swung forward and their elbows bent by so much [rad]."""
    pose = pose.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow = (space.base.joint_names.index(f"{side}_{joint}") for joint in ("shoulder", "elbow"))
        pose[shoulder] = (Rotation.from_rotvec([-swing, 0.0, 0.0]) * Rotation.from_rotvec(pose[shoulder])).as_rotvec()
        x, y, _ = arm_axis()
        pose[elbow] = bend * np.array([y, -sign * x, 0.0])
    return pose


def _place(
    space: ShapeSpace, outline: ImageOutline, mask: NDArray[np.bool_], yaw: float, pose: FloatArray, evidence: Evidence
) -> View:
    """Place the mean body, scaled to the stature, behind an outline."""
    rows, columns = np.nonzero(mask)
    height, width = mask.shape
    camera = Camera((rows.max() + 1 - rows.min()) * evidence.distance / evidence.stature, width, height)
    scale = evidence.stature / float(np.ptp(space.base.bind_vertices[:, 1]))
    fit = first_fit(space, Start(yaw, scale, np.zeros(3), "", 0.0), pose)
    metres = evidence.distance / camera.focal
    middle = np.array([np.median(columns), rows.max() + 0.5]) - camera.middle
    place = np.array([middle[0] * metres, -middle[1] * metres, -evidence.distance])
    return View(outline, fit.pose, replace(fit, translation=fit.translation + place), camera)


def _advance(
    space: ShapeSpace,
    views: tuple[View, ...],
    evidence: Evidence,
    trust: FloatArray,
    config: SilhouettesConfig,
    steps: int,
    stiff: float = 1.0,
) -> Solution:
    reach = _REACH_M
    for _ in range(steps):
        solution = step(space, views, evidence, trust, reach, config.outline_sigma_mm * 1e-3, _INDEPENDENT, stiff)
        views = solution.views
        reach = max(reach * 0.85, _LAST_REACH_M)
    return solution


def _report(space: ShapeSpace, solution: Solution, job: Job) -> Avatar:
    body = space.avatar(solution.parameters)
    tape, sigmas = Tape(body), {}
    for name, definition in DEFINITIONS.items():
        reading = tape.read(definition, body.bind_vertices)
        slope = np.einsum("nk,pnk->p", reading.gradient, space.fields[:, reading.vertices])
        open_part = _OPEN_SHARE.get(name, 0.0) * reading.value
        sigmas[name] = float(np.sqrt(slope @ solution.covariance @ slope + open_part**2))
        if name in _OPEN_SHARE:
            job.measure(
                **{f"{name}_m": round(reading.value, 4), f"{name}_interval_mm": round(1.96e3 * sigmas[name], 1)}
            )
    job.note("girths behind two outlines are intervals, not points; measure by tape where it matters")
    return replace(body, sigmas=sigmas)
