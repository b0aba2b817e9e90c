"""Stage of the fit in poses: the avatar takes one after another, and the draped garment goes along."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from pydantic import Field

from vto_pipeline.assess.fit import FitConfig
from vto_pipeline.assess.poses import openings_slide, stretch_by_part, verdict
from vto_pipeline.avatar.model.pose import clear_pose, morph
from vto_pipeline.avatar.template.regions import part_names
from vto_pipeline.cloth.collision.body.yielding import give_way
from vto_pipeline.cloth.drape import drape
from vto_pipeline.cloth.drape_config import DrapeConfig
from vto_pipeline.cloth.dynamics.body_motion import beside
from vto_pipeline.cloth.model.settings import checked
from vto_pipeline.cloth.rest_shape.edge_length_embedding import lengths_in_space
from vto_pipeline.cloth.simulation import default_skin
from vto_pipeline.errors import SimulationError
from vto_pipeline.geometry.topology import laid_edge_lengths
from vto_pipeline.io.runs.frame_log import FrameLog
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import Avatar, MovingBody
from vto_pipeline.model.garment import Garment
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.render.clear_body import clear_body
from vto_pipeline.render.dress import DressConfig, body_part, deform_render_mesh
from vto_pipeline.stages.output import most_detailed

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]

_BESIDE = 1.3  # m between two poses in the file to look at


class PosesConfig(DrapeConfig):
    """Settings of the fit in poses: those of a drape, and which poses."""

    poses: tuple[Literal["a_pose", "t_pose", "arms_down", "arms_up", "sitting", "step"], ...] = Field(
        ("arms_down", "arms_up", "step"), min_length=1, description="Poses to look at, each from where it was draped"
    )
    keyframes: int = Field(21, ge=2, le=500, description="Number of shapes on the way to a pose")
    ride_up_to_mm: float = Field(
        10_000.0, ge=0, description="The garment goes along with its body where that moves by less [mm]"
    )
    coarsen_above: int = Field(100_000, ge=100, description="Vertices above which a coarser mesh comes first")
    target_error_mm: float = Field(3.0, gt=0, le=100, description="Predicted error at which a pose is good enough [mm]")
    target_residual: float = Field(0.1, gt=0, le=1000, description="Residual force, as a share of weight, that will do")


def _poses(inputs: Inputs, settings: PosesConfig, job: Job) -> Outputs:
    log, scene = FrameLog(job.kept), []
    for number, name in enumerate(settings.poses):
        body = _posed(inputs, name, settings)
        if number == len(log.frames):
            log.add(*_in_pose(inputs, body, number, settings, job), {})
        if log.records[number]["reached"]:
            draped = TriangleMesh(log.frames[number], inputs["draped"].faces)
            scene += _shown(inputs, draped, body.final, number, name)
        else:
            job.warn(log.records[number]["verdict"])
    return {"pose_report": {"schema": 1, "poses": [dict(record) for record in log.records]}, "posed_scene": scene}


def _posed(inputs: Inputs, name: str, settings: PosesConfig) -> MovingBody:
    """Return the body on its way to a pose; it gives way, as flesh does, where its parts would press on the cloth."""
    avatar, cloth = inputs["avatar"], inputs["draped"]
    body = morph(avatar, clear_pose(avatar, name), settings.keyframes)
    edges = laid_edge_lengths(cloth, inputs["worn_rest"].corners(cloth.faces))
    skin = default_skin(float(np.median(edges))) if settings.skin_mm is None else 1e-3 * settings.skin_mm
    return give_way(body, skin, beside(avatar.vertices, cloth), at_end=True)[0]


def _in_pose(
    inputs: Inputs, body: MovingBody, number: int, settings: PosesConfig, job: Job
) -> tuple[FloatArray, dict[str, Any]]:
    """Return where the garment is when its body has taken a pose, and what is to be said of it there."""
    name, count = settings.poses[number], len(settings.poses)
    words = name.replace("_", " ")

    def progress(share: float, text: str) -> None:
        job.progress((number + share) / count, f"{words}: {text}")

    part = Job(progress, job.scratch, job.seed, job.force_all, job.memory)
    config = settings.model_dump(exclude={"poses", "keyframes"})
    try:
        found = drape(Garment(inputs["draped"], inputs["worn_rest"]), body, inputs["fabric"], config, part)
    except SimulationError as error:
        why = f"{words}: not reached; {error.problem}"
        return inputs["draped"].vertices, {"pose": name, "reached": False, "verdict": why}
    job.notes += [f"{words}: {text}" for text in (*part.notes, *part.warnings)]
    record = {"pose": name, "reached": True, "settled": found.audit["settled"], "error_mm": part.metrics["error_mm"]}
    return found.mesh.vertices, {**record, "seconds": part.metrics["seconds"], **_fit(inputs, found.mesh, body, name)}


def _fit(inputs: Inputs, draped: TriangleMesh, body: MovingBody, name: str) -> dict[str, Any]:
    """Return where the garment is tight in a pose, and what has slid, beside how it was draped."""
    before: Avatar = inputs["avatar"]
    limit, parts = checked(FitConfig, None).stretch_limit, part_names(before)
    rest = lengths_in_space(inputs["worn_rest"], inputs["draped"])
    standing = stretch_by_part(inputs["draped"], rest, before.mesh, parts, limit)
    posed = stretch_by_part(draped, rest, body.final, parts, limit)
    slides = openings_slide(inputs["draped"], before.mesh, draped, body.final)
    words = verdict(name, standing, posed, slides, limit)
    return {"stretch_limit": limit, "parts": posed, "parts_before": standing, "openings": slides, "verdict": words}


def _shown(inputs: Inputs, draped: TriangleMesh, body: TriangleMesh, number: int, name: str) -> list[GlbPart]:
    """Return the parts to look at: the garment in detail and its body, beside those of the poses before."""
    config, quiet = checked(DressConfig, None), Job()
    parts = deform_render_mesh(most_detailed(inputs), inputs["sim_mesh"], draped, config, quiet)
    shift = np.array([_BESIDE * number, 0.0, 0.0])
    return [
        replace(part, name=f"{name} {part.name}", mesh=replace(part.mesh, vertices=part.mesh.vertices + shift))
        for part in clear_body([*parts, body_part(body, config)])[0]
    ]


STAGES: tuple[Stage, ...] = (
    Stage(
        name="poses",
        about="the draped garment in other poses, and its fit in each",
        needs=("garment", "sim_mesh", "draped", "worn_rest", "fabric", "avatar"),
        optional=("garment_texture", "garment_mesh", "garment_surface", "garment_placement"),
        makes=("pose_report", "posed_scene"),
        run=_poses,
        settings=PosesConfig,
        piecewise=True,
        uses=("numba", "libigl", "pygltflib"),
    ),
)
