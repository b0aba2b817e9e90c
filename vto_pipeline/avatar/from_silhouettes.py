"""A body from a front and a side photo: shape, poses and cameras that fit both outlines, with uncertainties.

Two outlines do not determine girths: even perfect ones leave 13 to 21 mm of mean error at chest, waist and hip. So an
interval is reported.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.measuring.definitions import DEFINITIONS
from vto_pipeline.avatar.measuring.measuring_levels import find_levels, with_rows_at_levels
from vto_pipeline.avatar.measuring.population import population
from vto_pipeline.avatar.measuring.tape import Tape
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import pose_avatar
from vto_pipeline.avatar.model.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.avatar.model.stance import stance
from vto_pipeline.avatar.scan.bind_pose import to_bind_pose
from vto_pipeline.avatar.scan.report import extremity_weights
from vto_pipeline.avatar.scan.tangential_slide import slide_along_surface
from vto_pipeline.avatar.silhouettes.backdrop import overlap, segment_person
from vto_pipeline.avatar.silhouettes.fit import Evidence, Solution, run_steps
from vto_pipeline.avatar.silhouettes.initial_pose import initial_views, mean_body
from vto_pipeline.errors import AvatarError
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.frames import Silhouettes
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config

_OPEN_SHARE = {"chest_girth": 0.038, "waist_girth": 0.028, "hip_girth": 0.026}
"""Spread of a girth where its breadth and depth are known exactly, as a share of it.

Regressions in ANSUR II leave 0.023, 0.019 and 0.016. The rest is our assumption: a section's shape is less alike beyond
that survey (a hip's girth is 1.03 to 1.07 times its ellipse's, a chest's 1.04 to 1.12).
"""
_POOR_M, _BETTER = 0.012, 0.7
"""Outlines this far apart (both views together) raise the question whether the pictures are swapped."""
_SAME_VIEW = 0.8
"""Outlines of front and back have nine tenths in common at equal height, those of front and side half at most."""
_ENDS_SHARE = 0.25
"""How much head, hands and feet count: hair, fingers and shoes are not modelled."""


class SilhouettesConfig(Config):
    """Settings of the fit to two photos."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="Sex whose statistics complete the body"
    )
    distance_m: float = Field(default=2.5, gt=0.5, le=20, description="Approximate distance from camera to body [m]")
    height_m: float = Field(default=1.2, gt=0, le=10, description="Approximate camera height above the floor [m]")
    outline_sigma_mm: float = Field(
        default=4.0, gt=0, le=100, description="Uncertainty of a point on the outline: picture, cloth, model [mm]"
    )
    iterations: int = Field(default=20, ge=5, le=200, description="Gauss-Newton steps")
    max_wrong_mm: float = Field(
        default=25.0, gt=0, description="A larger mean distance of the outlines means that this is not a body [mm]"
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
    front, side = segment_person(front_image, str(silhouettes.front)), segment_person(side_image, str(silhouettes.side))
    if overlap(front, side) > _SAME_VIEW:
        raise AvatarError(
            "both pictures show the person from the same side, or from front and back",
            where=f"{silhouettes.front}, {silhouettes.side}",
            hint="take the second one after a quarter turn",
        )
    noise = config.outline_sigma_mm * 1e-3
    job.progress(0.0, "finding the pose")
    space, evidence = shape_space(SEX_SHARE[config.sex]), _evidence(config.sex, silhouettes, config)
    begin = initial_views(space, front, side, evidence, noise)
    if sum(begin.outline_errors) > _POOR_M:
        swapped = initial_views(space, side, front, evidence, noise)
        if sum(swapped.outline_errors) < _BETTER * sum(begin.outline_errors):
            raise AvatarError(
                "the outlines fit a body better with front and side swapped",
                where=f"{silhouettes.front}, {silhouettes.side}",
                hint="the first picture must be the one from the front",
            )
    job.progress(0.5, "fitting shape, poses and cameras")
    sexes = ("female", "male") if config.sex == "neutral" else (config.sex,)
    found = [(sex, _fit(sex, begin, silhouettes, config)) for sex in sexes]
    sex, solution = min(found, key=lambda one: one[1].misfit)
    space = shape_space(SEX_SHARE[sex])
    if len(found) > 1:
        job.note(f"sex was not given; the outlines fit a {sex} body better")
    for name, wrong in zip(("front", "side"), solution.outline_errors, strict=True):
        job.measure(**{f"{name}_outline_mm": round(wrong * 1e3, 2)})
        if wrong * 1e3 > config.max_wrong_mm:
            raise AvatarError(
                f"the {name} outline lies {wrong * 1e3:.0f} mm from any body's (at most {config.max_wrong_mm:g})",
                where=str(getattr(silhouettes, name)),
                hint="wear tight clothes, hold the arms off the body, and keep all else out of the picture",
            )
    return _report(space, solution, job)


def _evidence(sex: str, silhouettes: Silhouettes, config: SilhouettesConfig) -> Evidence:
    return Evidence(
        population(sex), Tape(shape_space(SEX_SHARE[sex]).base), silhouettes.stature, config.distance_m, config.height_m
    )


def _fit(sex: str, begin: Solution, silhouettes: Silhouettes, config: SilhouettesConfig) -> Solution:
    """Fit the body of a sex; the stance is known, the shape begins at the mean."""
    space = shape_space(SEX_SHARE[sex])
    mean = mean_body(space, silhouettes.stature, 0.0, begin.views[0].nominal)
    views = tuple(
        replace(view, fit=replace(view.fit, parameters=mean.parameters, expected=mean.expected)) for view in begin.views
    )
    trust = 1 - (1 - _ENDS_SHARE) * extremity_weights(space.base)
    evidence = _evidence(sex, silhouettes, config)
    return run_steps(space, views, evidence, trust, config.outline_sigma_mm * 1e-3, config.iterations)


def _report(space: ShapeSpace, solution: Solution, job: Job) -> Avatar:
    body = _unpose(space, solution.views[0].fit)
    tape, sigmas = Tape(body), {}
    for name, definition in DEFINITIONS.items():
        reading = tape.read(definition, body.bind_vertices)
        slope = reading.by_parameters(space.fields)
        open_part = _OPEN_SHARE.get(name, 0.0) * reading.value
        sigmas[name] = float(np.sqrt(slope @ solution.covariance @ slope + open_part**2))
        if name in _OPEN_SHARE:
            job.measure(
                **{f"{name}_m": round(reading.value, 4), f"{name}_interval_mm": round(1.96e3 * sigmas[name], 1)}
            )
    job.note("girths from two outlines are uncertain; measure with a tape where it matters")
    return replace(body, sigmas=sigmas)


def _unpose(space: ShapeSpace, fit: Fit) -> Avatar:
    """Return the body in the bind pose: trunk and legs keep the posture of the front view, as those of a scan do.

    An outline does not tell where a row of the template comes to lie; the rows move to where the body shows them.
    """
    pose = fit.pose.copy()
    pose[0] = 0.0  # the camera's tilt, not the body's
    upright = replace(fit, pose=pose, translation=np.zeros(3))
    posed, stands = posed_vertices(space, upright), stance(space, upright)
    standing = (posed - stands.translation) @ stands.yaw
    levelled = with_rows_at_levels(space, fit.parameters, standing, find_levels(standing, space.base))
    shift = (levelled.base.bind_vertices - space.base.bind_vertices) @ stands.yaw.T
    moved = slide_along_surface(posed, space.base.faces, shift)
    body, _ = to_bind_pose(levelled, upright, stance(levelled, upright), posed_vertices(levelled, upright), moved)
    return pose_avatar(body, np.zeros_like(pose), np.zeros(3))
