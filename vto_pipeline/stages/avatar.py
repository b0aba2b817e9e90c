"""Stages that make an avatar from scans, measurements or photos."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import Field

from vto_pipeline.avatar.from_dressed import fit_dressed
from vto_pipeline.avatar.from_measurements import MeasurementsConfig, fit_measurements
from vto_pipeline.avatar.from_scan import ScanConfig, fit_scan
from vto_pipeline.avatar.from_silhouettes import SilhouettesConfig, fit_silhouettes
from vto_pipeline.avatar.lifelike.lifelike import LifelikeConfig, lifelike_body
from vto_pipeline.avatar.measuring.avatar_measurements import landmarks, measure_avatar
from vto_pipeline.avatar.model.pose import clear_pose
from vto_pipeline.avatar.standing import turn_of
from vto_pipeline.io.captures.images import read_image
from vto_pipeline.model.job import Job
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]


class PoseConfig(Config):
    """Settings of the pose."""

    pose: Literal["as_fitted", "a_pose", "t_pose", "arms_down", "arms_up", "sitting", "step"] = Field(
        "as_fitted", description="How the avatar stands; as_fitted keeps the pose of the scan or of the template"
    )


def _register_mannequin(inputs: Inputs, settings: ScanConfig, job: Job) -> Outputs:
    return {"source_avatar": fit_scan(inputs["mannequin_surface"], settings, job)}


def _stand_source(inputs: Inputs, settings: Config, job: Job) -> Outputs:
    return {"source_turn": turn_of(inputs["mannequin_surface"], job)}


def _shape_mannequin(inputs: Inputs, settings: MeasurementsConfig, job: Job) -> Outputs:
    avatar = fit_measurements(inputs["mannequin_measurements"], settings, job)
    return {"source_avatar": avatar, "mannequin_surface": avatar.mesh}


def _fit_dressed(inputs: Inputs, settings: ScanConfig, job: Job) -> Outputs:
    avatar = fit_dressed(inputs["garment_surface"], inputs["dressed_measurements"], settings, job)
    return {"dressed_avatar": avatar, "source_avatar": avatar}


def _register_body(inputs: Inputs, settings: ScanConfig, job: Job) -> Outputs:
    return {"body_avatar": fit_scan(inputs["body_mesh"], settings, job)}


def _fit_measurements(inputs: Inputs, settings: MeasurementsConfig, job: Job) -> Outputs:
    return {"fitted_avatar": fit_measurements(inputs["body_measurements"], settings, job)}


def _fit_scan(inputs: Inputs, settings: ScanConfig, job: Job) -> Outputs:
    return {"fitted_avatar": fit_scan(inputs["body_surface"], settings, job)}


def _fit_silhouettes(inputs: Inputs, settings: SilhouettesConfig, job: Job) -> Outputs:
    pictures = inputs["body_silhouettes"]
    front, side = read_image(pictures.front), read_image(pictures.side)
    return {"fitted_avatar": fit_silhouettes(pictures, front, side, settings, job)}


def _pose(inputs: Inputs, settings: PoseConfig, job: Job) -> Outputs:
    avatar = inputs["fitted_avatar"]
    if settings.pose == "as_fitted":
        job.leave_out("posing", "the avatar keeps the pose it was fitted in")
        return {"avatar": avatar}
    return {"avatar": clear_pose(avatar, settings.pose)}


def _lifelike(inputs: Inputs, settings: LifelikeConfig, job: Job) -> Outputs:
    return {"lifelike_body": lifelike_body(inputs["avatar"], inputs["lifelike_data"], settings, job)}


def _measure(inputs: Inputs, settings: Config, job: Job) -> Outputs:
    avatar = inputs["avatar"]
    return {"measurements": measure_avatar(avatar), "landmarks": landmarks(avatar)}


STAGES: tuple[Stage, ...] = (
    Stage(
        name="register_mannequin",
        about="the template fitted to the mannequin, so that it can morph into the customer",
        needs=("mannequin_surface",),
        makes=("source_avatar",),
        run=_register_mannequin,
        settings=ScanConfig,
        uses=("scipy", "libigl"),
    ),
    Stage(
        name="stand_source",
        about="the axis along which the body stands that the garment was on: both are turned alike",
        needs=("mannequin_surface",),
        makes=("source_turn",),
        run=_stand_source,
    ),
    Stage(
        name="shape_mannequin",
        about="a mannequin built from its measurements",
        needs=("mannequin_measurements",),
        makes=("source_avatar", "mannequin_surface"),
        run=_shape_mannequin,
        settings=MeasurementsConfig,
        uses=("scipy",),
    ),
    Stage(
        name="fit_dressed",
        about="a mannequin that was never scanned bare, estimated inside the dressed scan",
        needs=("garment_surface", "dressed_measurements"),
        makes=("dressed_avatar", "source_avatar"),
        run=_fit_dressed,
        settings=ScanConfig,
        uses=("scipy", "libigl", "pyfqmr"),
    ),
    Stage(
        name="register_body",
        about="the template fitted to the body mesh, so that the source body can morph into it",
        needs=("body_mesh", "source_avatar"),
        makes=("body_avatar",),
        run=_register_body,
        settings=ScanConfig,
        uses=("scipy", "libigl"),
    ),
    Stage(
        name="fit_measurements",
        about="the avatar that matches the tape measurements",
        needs=("body_measurements",),
        makes=("fitted_avatar",),
        run=_fit_measurements,
        settings=MeasurementsConfig,
        uses=("scipy",),
    ),
    Stage(
        name="fit_scan",
        about="the avatar registered to a scan: pose, shape, then detail",
        needs=("body_surface",),
        makes=("fitted_avatar",),
        run=_fit_scan,
        settings=ScanConfig,
        uses=("scipy", "libigl"),
    ),
    Stage(
        name="fit_silhouettes",
        about="the avatar fitted to a front and a side photo",
        needs=("body_silhouettes",),
        makes=("fitted_avatar",),
        run=_fit_silhouettes,
        settings=SilhouettesConfig,
        uses=("opencv-python-headless", "scipy"),
    ),
    Stage(
        name="pose",
        about="the avatar in the pose it is draped in",
        needs=("fitted_avatar",),
        makes=("avatar",),
        run=_pose,
        settings=PoseConfig,
    ),
    Stage(
        name="lifelike",
        about="the avatar with a face, fingers and toes, for pictures",
        needs=("avatar", "lifelike_data"),
        makes=("lifelike_body",),
        run=_lifelike,
        settings=LifelikeConfig,
        uses=("scipy", "libigl"),
    ),
    Stage(
        name="measure",
        about="the avatar's measurements and landmarks (ISO 8559-1)",
        needs=("avatar",),
        makes=("measurements", "landmarks"),
        run=_measure,
    ),
)
