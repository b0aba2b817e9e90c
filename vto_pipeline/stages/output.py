"""Stages of the output: render mesh, fit report, page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vto_pipeline.assess.fit import FitConfig, assess_fit
from vto_pipeline.avatar.measuring.avatar_measurements import fit_levels
from vto_pipeline.avatar.template.regions import trunk_vertices
from vto_pipeline.cloth.judge.worn import vertex_maps
from vto_pipeline.cloth.rest_shape.edge_length_embedding import lengths_in_space
from vto_pipeline.geometry.remeshing.seams import cut_open
from vto_pipeline.geometry.rigid import transform_mesh
from vto_pipeline.geometry.topology import face_areas
from vto_pipeline.model.job import Job
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.settings import Config
from vto_pipeline.model.texture import TexturedMesh
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.render.carry_skin import carry_skin
from vto_pipeline.render.clear_body import clear_body, cut_by_body
from vto_pipeline.render.dress import BODY, DressConfig, body_part, deform_render_mesh
from vto_pipeline.render.marks import mark_places
from vto_pipeline.render.tuck import tuck
from vto_pipeline.report.page import build_page
from vto_pipeline.stages.motion import shown_motion

Inputs = Mapping[str, Any]
Outputs = Mapping[str, Any]


def _transfer(inputs: Inputs, settings: DressConfig, job: Job) -> Outputs:
    garment = most_detailed(inputs)
    parts = deform_render_mesh(garment, inputs["sim_mesh"], inputs["draped"], settings, job)
    if "collider" in inputs:
        parts, moved = clear_body([*parts, body_part(_shown_body(inputs), settings)])
        cut = cut_by_body(parts)
        job.measure(moved_out_of_body=moved, cut_by_body=cut)
        if cut:
            job.warn(f"{cut} triangles of the render mesh pass through the body, deeper than pictures hide: skin shows")
        if not settings.body:
            parts.pop()
    return {"render_mesh": parts}


def _shown_body(inputs: Inputs) -> TriangleMesh:
    """Return the body that wears the draped garment: lifelike where it was made so."""
    body: TriangleMesh = inputs["collider"].final
    return tuck(inputs["lifelike_body"].mesh, body, [inputs["draped"]]) if "lifelike_body" in inputs else body


def most_detailed(inputs: Inputs) -> TriangleMesh | TexturedMesh:
    """Return the garment with its picture, from photos, its file or its scan, or else as it was repaired."""
    if "garment_texture" in inputs:
        textured: TexturedMesh = inputs["garment_texture"]
        return textured
    given: TriangleMesh | None = inputs.get("garment_mesh")
    if given is not None and given.skin is not None:
        mesh = replace(given, texture=given.skin.places, skin=None)
        return TexturedMesh(mesh, given.skin.picture, np.ones(given.skin.picture.shape[:2], dtype=bool))
    scan: TriangleMesh | None = inputs.get("garment_surface")
    if scan is not None and scan.skin is not None:
        placed = transform_mesh(scan, inputs["garment_placement"]) if "garment_placement" in inputs else scan
        return carry_skin(placed, inputs["garment"])
    garment: TriangleMesh = inputs["garment"] if given is None or given.texture is None else given
    return garment


def _assess(inputs: Inputs, settings: FitConfig, job: Job) -> Outputs:
    body: TriangleMesh = inputs["collider"].final
    avatar = inputs.get("avatar")
    if avatar is None:
        job.leave_out("ease at chest, waist and hip", "a plain mesh has no landmarks; fit an avatar to it")
    report, maps = assess_fit(
        inputs["draped"],
        lengths_in_space(inputs["worn_rest"], inputs["draped"]),
        body,
        {} if avatar is None else fit_levels(avatar),
        inputs["fabric"],
        settings,
        job,
        trunk=None if avatar is None else trunk_vertices(avatar),
        observed_share=_observed_share(inputs),
        mode=inputs["worn_rest"].worn_as,
    )
    worn = vertex_maps(inputs["draped"], inputs["worn_rest"], body, inputs["fabric"])
    return {"fit_report": report, "fit_maps": {**maps, **worn}}


def _observed_share(inputs: Inputs) -> float | None:
    """Share of the garment's area that a sensor saw."""
    if "observed" not in inputs or "garment" not in inputs:
        return None
    garment: TriangleMesh = inputs["garment"]
    area = face_areas(garment)
    return float(area[inputs["observed"][garment.faces].all(axis=1)].sum() / area.sum())


def _page(inputs: Inputs, settings: Config, job: Job) -> Outputs:
    parts = {name: value for name, value in inputs.items() if name != "run_record"}
    if "garment" in parts and "render_mesh" not in parts:
        detailed = most_detailed(parts)
        if isinstance(detailed, TexturedMesh):
            parts["garment"] = [cut_open("garment", detailed.mesh, detailed.picture)]
    if "render_mesh" in parts:
        shown = parts["render_mesh"]
        parts["render_mesh"] = [part for part in shown if part.name != BODY]
        if ("avatar" not in parts or "lifelike_body" in parts) and len(parts["render_mesh"]) < len(shown):
            parts["worn_by"] = next(part.mesh for part in shown if part.name == BODY)
    if all(name in inputs for name in ("draped_motion", "avatar", "avatar_motion")):
        parts["motion"] = shown_motion(inputs["draped_motion"], inputs["avatar"], inputs["avatar_motion"])
    places = _crossings(inputs.get("audit", {}))
    if places:
        parts["crossings"] = mark_places(np.array(places))
    return {"page": build_page(inputs["run_record"], parts)}


def _crossings(audit: Mapping[str, Any]) -> list[list[float]]:
    """Return where a garment was found to cross the body, itself or another, or to lie outside an outer one [m]."""
    kinds = ("body_intersection", "self_intersection", "layer_intersection", "out_of_order")
    return [place for kind in kinds for place in audit.get(f"{kind}_places", [])]


STAGES: tuple[Stage, ...] = (
    Stage(
        name="transfer",
        about="the detailed garment follows the draped simulation mesh, on the body",
        needs=("garment", "sim_mesh", "draped"),
        optional=(
            "garment_texture",
            "garment_mesh",
            "garment_surface",
            "garment_placement",
            "collider",
            "lifelike_body",
        ),
        makes=("render_mesh",),
        run=_transfer,
        settings=DressConfig,
        uses=("libigl", "pygltflib", "pyfqmr"),
    ),
    Stage(
        name="assess",
        about="ease, stretch and clearance of the garment",
        needs=("draped", "worn_rest", "collider", "fabric"),
        optional=("avatar", "garment", "observed"),
        makes=("fit_report", "fit_maps"),
        run=_assess,
        settings=FitConfig,
        uses=("libigl",),
    ),
    Stage(
        name="page",
        about="everything on one page, with a 3D view",
        needs=(),
        optional=(
            "garment_surface",
            "garment_placement",
            "body_surface",
            "mannequin_surface",
            "labels",
            "garment",
            "garment_texture",
            "openings",
            "avatar",
            "lifelike_body",
            "measurements",
            "body_measurements",
            "draped",
            "audit",
            "trace",
            "render_mesh",
            "fit_report",
            "fit_maps",
            "draped_motion",
            "avatar_motion",
            "motion_maps",
            "motion_report",
            "pose_report",
        ),
        makes=("page",),
        run=_page,
        final=True,
    ),
)
