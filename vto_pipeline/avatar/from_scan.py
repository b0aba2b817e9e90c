"""A body from a scan, whole or partial: facing and place, then pose and shape, then a smooth displacement."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.measuring.avatar_measurements import measure_avatar
from vto_pipeline.avatar.measuring.measuring_levels import find_levels, with_rows_at_levels
from vto_pipeline.avatar.model.fit import Fit, posed_vertices
from vto_pipeline.avatar.model.pose import named_pose
from vto_pipeline.avatar.model.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.avatar.model.stance import Stance, stance
from vto_pipeline.avatar.scan.bind_pose import separate_thighs, to_bind_pose
from vto_pipeline.avatar.scan.bust_points import toward_bust_points
from vto_pipeline.avatar.scan.clothed import fit_under_clothes
from vto_pipeline.avatar.scan.correspondence import Correspondences, Target
from vto_pipeline.avatar.scan.displacement import displace
from vto_pipeline.avatar.scan.initial_pose import InitialPose, upright_initial_poses
from vto_pipeline.avatar.scan.registration import covariance, initial_fit, refine_registration
from vto_pipeline.avatar.scan.report import (
    CORE,
    extremity_weights,
    refuse_garment,
    refuse_implausible_build,
    refuse_non_body,
    refuse_shape_of_no_body,
    report_registration,
)
from vto_pipeline.avatar.scan.tangential_slide import slide_along_surface
from vto_pipeline.avatar.scan.uncertainty.observed import level_sigmas, surface_sigmas
from vto_pipeline.avatar.scan.uncertainty.people import as_people_differ
from vto_pipeline.avatar.scan.uncertainty.unobserved import unseen_sigmas
from vto_pipeline.avatar.scan.upright import in_metres, without_surroundings
from vto_pipeline.avatar.standing import refuse_misread_unit
from vto_pipeline.avatar.template.template import JOINT_KINDS
from vto_pipeline.geometry.closest import closest_points
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, Measurements
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

_UNLIKE = {"wrist": 1.0, "ankle": 0.9}
"""How little of the scan is followed beyond these joints: our hands are mittens and our feet have no toes."""
_NOISE_SHARE = 0.2
"""Spread that distances are taken to have, as a share of the reach."""


class ScanConfig(Config):
    """Settings of the registration."""

    sex: Literal["female", "male", "neutral"] = Field(
        default="neutral", description="Sex of the mean body to start from"
    )
    probes: int = Field(default=10_000, ge=500, le=100_000, description="Points sampled on the scan for the fit")
    iterations: int = Field(default=20, ge=5, le=200, description="Gauss-Newton steps over pose and shape")
    reach_mm: float = Field(default=60.0, gt=0, le=300, description="Distance of down-weighting at the start [mm]")
    final_reach_mm: float = Field(default=10.0, gt=0, le=100, description="Distance of down-weighting at the end [mm]")
    stiffness: tuple[float, ...] = Field(
        default=(100.0, 20.0, 4.0, 1.0, 0.3, 0.1), description="Stiffnesses of the displacement, decreasing"
    )
    rounds: int = Field(default=3, ge=1, le=50, description="Displacement solves at each stiffness")
    clothed: bool = Field(
        default=False,
        description="The person is clothed: the body is kept inside the scan and flagged as an estimate",
    )
    max_mean_mm: float = Field(
        default=15.0, gt=0, description="A larger mean distance means that this is not a body [mm]"
    )


@dataclass(frozen=True)
class Begun:
    """A registration of pose and shape.

    Args:
        space: The shape space.
        fit: Its parameters, pose and place.
        scan: What was fitted to: +Y up, without floor and surroundings [m].
        target: The same, prepared for closest points.
        posed: The model's body there [m], shape (V, 3).
    """

    space: ShapeSpace
    fit: Fit
    scan: TriangleMesh
    target: Target
    posed: FloatArray


def fit_scan(
    scan: TriangleMesh, config: ScanConfig | None = None, job: Job | None = None, tape: Measurements | None = None
) -> Avatar:
    """Return our body registered to a scan, posed as the scan and in its frame: metres, its upward axis turned to +Y.

    Args:
        scan: Body or dress form; unit, upward axis and facing are detected; head, hands, legs may be missing; floor
            and small pieces are dropped.
        config: Settings.
        job: Receives mean, rms and p95 of the distance from scan to body [mm]: of all points, of the core (no head,
            hands, feet), and of the explained ones (nearer than 10 mm: no stand, floor or hair), and their share.
        tape: What was measured of the body under clothes; only with `clothed`.

    Raises:
        AvatarError: the scan is no body, or a garment, with what is missing; or it is bent and cannot be reconstructed.
    """
    config, job = config or ScanConfig(), job or Job()
    job.progress(0.0, "finding the body's facing and size")
    metric = in_metres(scan, job)
    refuse_misread_unit(metric)
    begun = begin_registration(metric, config, job)
    space, fit, kept, target, posed = begun.space, begun.fit, begun.scan, begun.target, begun.posed
    job.progress(0.6, "fitting the surface to the scan")
    if not config.clothed:
        refuse_shape_of_no_body(kept, space, posed)
    vertices, softest = _displaced(space, fit, target, posed, config.stiffness, config.rounds)
    refuse_non_body(kept, space, vertices, config.max_mean_mm)
    refuse_garment(kept, space, vertices)
    stands = stance(space, fit)
    caveats = []
    if config.clothed:
        job.progress(0.75, "finding the body inside the clothes")
        shell, _ = to_bind_pose(space, fit, stands, posed, vertices)
        fit, sigmas = fit_under_clothes(space, fit, target, shell, job, tape)
        # which posture is the body's own does not show
        stands = replace(stance(space, fit), joints=space.joints(fit.parameters), pose=fit.pose)
        stands = replace(stands, translation=fit.translation)
        vertices = separate_thighs(space, fit, posed_vertices(space, fit))
        job.measure(estimated_under_clothing=True)
        job.warn("the body is an estimate under clothing: check with a tape before choosing a size by it")
        caveats.append("estimated under clothing")
    elif stands.stands:
        job.progress(0.75, "finding the body's measuring levels")
        space, risen = _levelled(space, fit, stands, kept, vertices)
        stands = stance(space, fit)
        vertices, _ = _displaced(space, fit, target, risen, (softest,), config.rounds)
    else:
        job.warn(
            f"the body is not upright: a part of it leans {np.rad2deg(stands.lean):.0f} degrees. Its "
            "measurements are those of the body brought upright, and less certain"
        )
        caveats.append("brought upright")
    job.progress(0.9, "returning the body to the bind pose")
    posed = separate_thighs(space, fit, posed_vertices(space, fit))
    body, bad = to_bind_pose(space, fit, stands, posed, vertices)
    if not stands.stands:
        refuse_implausible_build(measure_avatar(body), stands.lean)
    if not config.clothed:
        parts = (
            unseen_sigmas(space, _uncertainty(space, target, fit, config), target, posed, body, stands.stands),
            level_sigmas(body),
            surface_sigmas(space, target, body),
        )
        sigmas = {name: math.hypot(*(part[name] for part in parts)) for name in parts[0]}
        sigmas = as_people_differ(body, sigmas, target)
    caveats += report_registration(kept, space, body.vertices, job)
    job.measure(tangled_faces=bad)
    if bad:
        job.warn(f"{bad} faces of the registered body still pass through others, where the scan's own limbs touch")
    return replace(body, sigmas=sigmas, caveats=tuple(caveats))


def begin_registration(metric: TriangleMesh, config: ScanConfig, job: Job) -> Begun:
    """Return pose and shape of the model's body that comes nearest to a scan, before its surface is displaced.

    Args:
        metric: The scan in metres; its upward axis and facing are detected.
        config: Settings.
        job: Notified of what was turned or left out.

    Raises:
        AvatarError: it is tall in no direction.
    """
    kept, guesses = upright_initial_poses(metric, job)
    target = Target(kept, config.probes, job.seed)
    space = shape_space(SEX_SHARE[config.sex])
    tries = [_pose_and_shape(space, target, guess, config, job, steps=8) for guess in guesses[:2]]
    scores = [_score(space, target, fit) for fit in tries]
    fit = _pose_and_shape(space, target, tries[int(np.argmin(scores))], config, job, steps=config.iterations)
    posed = separate_thighs(space, fit, posed_vertices(space, fit))
    whole, kept = kept, without_surroundings(kept, TriangleMesh(posed, space.base.faces), job)
    if kept is not whole:
        target = Target(kept, config.probes, job.seed)
    return Begun(space, fit, kept, target, posed)


def _levelled(
    space: ShapeSpace, fit: Fit, stands: Stance, scan: TriangleMesh, vertices: FloatArray
) -> tuple[ShapeSpace, FloatArray]:
    """Return the space with its rows at the body's own levels, and the body with its rows slid there."""
    upright = (vertices - stands.translation) @ stands.yaw
    found = find_levels(upright, space.base)
    levelled = with_rows_at_levels(space, fit.parameters, upright, found)
    shift = (levelled.base.bind_vertices - space.base.bind_vertices) @ stands.yaw.T
    if "chest" in found:
        seen = (scan.vertices - stands.translation) @ stands.yaw
        shift += toward_bust_points(upright + shift @ stands.yaw, seen, space.base) @ stands.yaw.T
    return levelled, slide_along_surface(vertices, space.base.faces, shift)


def _displaced(
    space: ShapeSpace, fit: Fit, target: Target, start: FloatArray, stiffness: tuple[float, ...], rounds: int
) -> tuple[FloatArray, float]:
    unlike = np.array([_UNLIKE.get(kind, 0.0) for kind in JOINT_KINDS])
    trust = 1 - space.base.weights @ unlike
    core = extremity_weights(space.base) < CORE
    vertices, softest = displace(target, start, space.base.faces, trust, core, stiffness, rounds)
    return separate_thighs(space, fit, vertices), softest


def _pose_and_shape(
    space: ShapeSpace, target: Target, begin: InitialPose | Fit, config: ScanConfig, job: Job, steps: int
) -> Fit:
    if isinstance(begin, InitialPose):
        fit, reach = initial_fit(space, begin, named_pose(space.base, begin.pose_name).pose), config.reach_mm
    else:
        fit, reach = begin, config.reach_mm / 2
    fall = (config.final_reach_mm / reach) ** (1 / steps)
    for step in range(steps):
        pairs = _pairs(space, target, fit, reach)
        fit = refine_registration(space, fit, pairs, noise=_NOISE_SHARE * reach * 1e-3)
        reach *= fall
        job.progress(0.1 + 0.5 * step / steps, f"pose and shape, step {step + 1} of {steps}")
    return fit


def _pairs(space: ShapeSpace, target: Target, fit: Fit, reach_mm: float) -> Correspondences:
    # what the scan may lack must not reach out for the rest of it
    chosen = np.flatnonzero(extremity_weights(space.base) < CORE)[::3]
    return target.pairs(posed_vertices(space, fit), space.base.faces, chosen, reach_mm * 1e-3)


def _uncertainty(space: ShapeSpace, target: Target, fit: Fit, config: ScanConfig) -> FloatArray:
    pairs = _pairs(space, target, fit, config.final_reach_mm)
    return covariance(space, fit, pairs, noise=_NOISE_SHARE * config.final_reach_mm * 1e-3)


def _score(space: ShapeSpace, target: Target, fit: Fit) -> float:
    vertices = posed_vertices(space, fit)
    _, _, distance = closest_points(target.probes, vertices, space.base.faces)
    return float(np.minimum(distance, 0.05).mean())
