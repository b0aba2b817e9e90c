"""The page of several garments: shown together, assessed one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.job import Job
from vto_pipeline.model.render import GlbPart
from vto_pipeline.model.settings import Config
from vto_pipeline.pipeline.stage import Stage
from vto_pipeline.render.dress import BODY
from vto_pipeline.render.tuck import innermost

OWN_PARTS = ("render_mesh", "fit_report", "fit_maps")
"""What is made of each draped garment."""

_COLORS = ((0.14, 0.27, 0.53), (0.55, 0.21, 0.10), (0.19, 0.36, 0.16), (0.36, 0.20, 0.46))  # linear RGB
_SHARED = (
    "body_surface",
    "mannequin_surface",
    "avatar",
    "lifelike_body",
    "measurements",
    "body_measurements",
    "audit",
    "trace",
)


def outfit_page(stage: Stage, names: Sequence[str]) -> Stage:
    """Return the row of the page for these garments.

    Args:
        stage: The row for one garment.
        names: Of the garments, inner first.
    """
    own = {f"{name}_{part}": (name, part) for name in names for part in ("draped", *OWN_PARTS)}

    def run(inputs: Mapping[str, Any], settings: Config, job: Job) -> Mapping[str, Any]:
        parts = {artifact: value for artifact, value in inputs.items() if artifact not in own}
        found: dict[str, dict[str, Any]] = {part: {} for part in ("draped", *OWN_PARTS)}
        for artifact, (name, part) in own.items():
            if artifact in inputs:
                found[part][name] = inputs[artifact]
        if found["draped"]:
            parts["draped"] = concatenate(list(found["draped"].values()))
        if found["fit_maps"] and found["fit_maps"].keys() == found["draped"].keys():
            maps = list(found["fit_maps"].values())
            parts["fit_maps"] = {key: np.concatenate([one[key] for one in maps]) for key in maps[0]}
        if found["render_mesh"]:
            parts["render_mesh"] = joined_parts(found["render_mesh"])
        parts["fit_reports"] = found["fit_report"]
        if "audit" in parts:
            parts["audit"] = {name: value for name, value in parts["audit"].items() if name != "layers"}
        return stage.run(parts, settings, job)

    return replace(stage, optional=(*_SHARED, *own), run=run)


def joined_parts(garments: Mapping[str, Sequence[GlbPart]]) -> list[GlbPart]:
    """Return the parts of several garments' render meshes, by their names, inner first, and their body once."""
    names, every = list(garments), [(name, part) for name, some in garments.items() for part in some]
    parts = [_named_part(part, name, names) for name, part in every if part.name != BODY]
    bodies = [part for _, part in every if part.name == BODY]  # all wear the same, tucked under each
    return parts + [replace(body, mesh=innermost([one.mesh for one in bodies], _normals(body))) for body in bodies[:1]]


def _normals(part: GlbPart) -> FloatArray:
    return vertex_normals(part.mesh) if part.normals is None else part.normals


def _named_part(part: GlbPart, name: str, names: Sequence[str]) -> GlbPart:
    """Return a part with its garment's name, and a colour where it has none of its own."""
    plain = part.mesh.colors is None and part.texture is None
    color = (*_COLORS[names.index(name) % len(_COLORS)], 1.0) if plain else part.base_color
    return replace(part, name=f"{name} {part.name}", base_color=color)
