"""Stages of the drape: from the source body to the customer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from vto_pipeline.avatar.model.pose import morph
from vto_pipeline.avatar.open_mesh import refuse_open_mesh
from vto_pipeline.avatar.scan.body_transfer import transfer_motion
from vto_pipeline.avatar.standing import stood_up, warn_of_several
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.placement.regrade import GradeConfig, worn_rest
from vto_pipeline.geometry.metres import need_metres
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.io.fabric_formats.assumed import assumption_notes
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]


class MorphConfig(Config):
    """Settings of the body that the garment is draped on."""

    keyframes: int = Field(21, ge=2, le=500, description="Number of shapes from source body to customer")


def _morph(inputs: Inputs, settings: MorphConfig, job: Job) -> Outputs:
    avatar = inputs["avatar"]
    if "source_avatar" not in inputs:
        job.leave_out("morphing", "the source body is not known, so the body does not change")
        return {"collider": MovingBody(avatar.vertices[np.newaxis], avatar.faces)}
    return {"collider": morph(inputs["source_avatar"], avatar, settings.keyframes)}


def _mesh_morph(inputs: Inputs, settings: MorphConfig, job: Job) -> Outputs:
    body = stood_up(need_metres(inputs["body_mesh"], "a body"), job)
    refuse_open_mesh(body)
    warn_of_several(body, job)
    if "body_avatar" not in inputs:
        job.leave_out("fitting an avatar", "a body mesh was given, and the cloth is draped on it directly")
        return {"collider": MovingBody(body.vertices[np.newaxis], body.faces)}
    motion = morph(inputs["source_avatar"], inputs["body_avatar"], settings.keyframes)
    return {"collider": transfer_motion(body, motion)}


def in_body_frame(mesh: TriangleMesh, inputs: Inputs) -> TriangleMesh:
    """Return a garment's mesh turned as the body that it was on, if that is known."""
    turn = inputs.get("source_turn")
    return mesh if turn is None else transform_mesh(mesh, turn)


def _grade(inputs: Inputs, settings: GradeConfig, job: Job) -> Outputs:
    mesh, rest = inputs["sim_mesh"], inputs["rest_shape"]
    lain = in_body_frame(TriangleMesh(rest.positions, mesh.faces), inputs)
    garment = Garment(in_body_frame(mesh, inputs), replace(rest, positions=lain.vertices))
    return {"worn_rest": worn_rest(garment, inputs["collider"], settings, job)}


def _drape(inputs: Inputs, settings: DrapeConfig, job: Job) -> Outputs:
    for text in assumption_notes(inputs["fabric"]):
        job.note(text)
    mesh = in_body_frame(inputs["sim_mesh"], inputs)
    pattern = inputs.get("garment_pattern")
    garment = Garment(mesh, inputs["worn_rest"], pattern is not None, pattern is not None and pattern.worn)
    draped = drape(garment, inputs["collider"], inputs["fabric"], settings, job)
    return {"draped": draped.mesh, "audit": dict(draped.audit), "trace": tuple(draped.trace)}


STAGES: tuple[Stage, ...] = (
    Stage(
        name="morph",
        about="a body that morphs from the source body into the customer",
        needs=("avatar",),
        optional=("source_avatar",),
        makes=("collider",),
        run=_morph,
        settings=MorphConfig,
    ),
    Stage(
        name="mesh.morph",
        about="the body mesh as given, +Y up; the source body, if known, morphs into it",
        needs=("body_mesh",),
        optional=("source_avatar", "body_avatar"),
        makes=("collider",),
        run=_mesh_morph,
        settings=MorphConfig,
    ),
    Stage(
        name="grade",
        about="the same garment, or the garment made in the customer's size",
        needs=("sim_mesh", "rest_shape", "collider"),
        optional=("source_turn",),
        makes=("worn_rest",),
        run=_grade,
        settings=GradeConfig,
    ),
    Stage(
        name="drape",
        about="the garment at rest on the body",
        needs=("sim_mesh", "worn_rest", "collider", "fabric"),
        optional=("garment_pattern", "source_turn"),
        makes=("draped", "audit", "trace"),
        run=_drape,
        settings=DrapeConfig,
        uses=("numba", "libigl", "pymetis"),
    ),
)
