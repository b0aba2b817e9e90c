"""A body from a scan, whole or partial: facing and place, then pose and shape, then a smooth displacement."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.correspondence import Target, closest_points
from vto_pipeline.avatar.displacement import displace
from vto_pipeline.avatar.pose import named_pose
from vto_pipeline.avatar.registration import Fit, first_fit, model, refine
from vto_pipeline.avatar.scan_report import CORE, check, ends, report
from vto_pipeline.avatar.scan_start import Start, clean, starts
from vto_pipeline.avatar.settle import part_thighs, settle
from vto_pipeline.avatar.shape import SEX_SHARE, ShapeSpace, shape_space
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config

_NOISE_SHARE = 0.2
"""Spread that distances are taken to have, as a share of the reach."""


class ScanConfig(Config):
    """Settings of the registration."""

    sex: Literal["female", "male", "neutral"] = Field(default="neutral", description="whose mean body to begin with")
    probes: int = Field(default=3000, ge=500, le=50_000, description="scan points used while fitting pose and shape")
    iterations: int = Field(default=20, ge=5, le=200, description="Gauss-Newton steps over pose and shape")
    reach_mm: float = Field(
        default=60.0, gt=0, le=300, description="distance at which a point begins to count little, at first [mm]"
    )
    final_reach_mm: float = Field(default=10.0, gt=0, le=100, description="the same at the end [mm]")
    stiffness: tuple[float, ...] = Field(
        default=(100.0, 20.0, 4.0, 1.0, 0.3), description="of the displacement, falling"
    )
    rounds: int = Field(default=3, ge=1, le=50, description="displacement solves at each stiffness")
    max_mean_mm: float = Field(
        default=15.0, gt=0, description="a larger mean distance means that this is not a body [mm]"
    )


def fit_scan(scan: TriangleMesh, config: ScanConfig | None = None, job: Job | None = None) -> Avatar:
    """Return our body registered to a scan, posed as the scan and in its frame.

    Args:
        scan: Body or dress form [m], +Y up, any facing; head, hands, legs may be missing; floor and crumbs are dropped.
        config: Settings.
        job: Receives mean, rms and p95 of the distance from scan to body [mm]: of all points, of the core (no head,
            hands, feet), and of the explained ones (nearer than 10 mm: no stand, floor or hair), and their share.

    Raises:
        AvatarError: the scan is not a body, with what is missing.
    """
    config, job = config or ScanConfig(), job or Job()
    job.progress(0.0, "find the body's facing and size")
    kept = clean(scan, job)
    target = Target(kept, config.probes, job.seed)
    space = shape_space(SEX_SHARE[config.sex])
    guesses = starts(kept)
    tries = [_pose_and_shape(space, target, guess, config, job, steps=8) for guess in guesses[:2]]
    scores = [_score(space, target, fit) for fit in tries]
    fit = _pose_and_shape(space, target, tries[int(np.argmin(scores))], config, job, steps=config.iterations)
    job.progress(0.6, "displace the body onto the scan")
    posed = part_thighs(space, fit, model(space, fit))
    hands = [k for k, name in enumerate(space.base.joint_names) if name.endswith("wrist")]
    trust = 1 - space.base.weights[:, hands].sum(axis=1)
    vertices = displace(target, posed, space.base.faces, trust, config.stiffness, config.rounds)
    vertices = part_thighs(space, fit, vertices)
    check(kept, space, vertices, config.max_mean_mm)
    job.progress(0.9, "carry the body back to the bind pose")
    body, bad = settle(space, fit, posed, vertices)
    report(kept, space, body.vertices, job)
    job.measure(tangled_faces=bad)
    if bad:
        job.warn(f"{bad} faces of the registered body still pass through others, where the scan's own limbs touch")
    return body


def _pose_and_shape(
    space: ShapeSpace, target: Target, begin: Start | Fit, config: ScanConfig, job: Job, steps: int
) -> Fit:
    if isinstance(begin, Start):
        fit, reach = first_fit(space, begin, named_pose(space.base, begin.pose_name).pose), config.reach_mm
    else:
        fit, reach = begin, config.reach_mm / 2
    # what the scan may lack must not reach out for the rest of it
    chosen = np.flatnonzero(ends(space) < CORE)[::3]
    fall = (config.final_reach_mm / reach) ** (1 / steps)
    for step in range(steps):
        pairs = target.pairs(model(space, fit), space.base.faces, chosen, reach * 1e-3)
        fit = refine(space, fit, pairs, noise=_NOISE_SHARE * reach * 1e-3)
        reach *= fall
        job.progress(0.1 + 0.5 * step / steps, f"pose and shape, step {step + 1} of {steps}")
    return fit


def _score(space: ShapeSpace, target: Target, fit: Fit) -> float:
    vertices = model(space, fit)
    _, _, distance = closest_points(target.probes, vertices, space.base.faces)
    return float(np.minimum(distance, 0.05).mean())
