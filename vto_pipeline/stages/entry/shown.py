"""What a run made that can be drawn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vto_pipeline.errors import InputError
from vto_pipeline.model.mesh import Skin, TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.numerics.srgb import encode_srgb
from vto_pipeline.render.dress import BODY
from vto_pipeline.render.tint import SKIN, tint
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.outfit_page import joined_parts

_ALONE = (
    "garment",
    "garment_surface",
    "lifelike_body",
    "avatar",
    "fitted_avatar",
    "body_surface",
    "mannequin_surface",
    "surface",
)
"""What is shown of a run without a drape: the first of these that it made."""

_UNDYED = (1.0, 1.0, 1.0)  # what glTF assumes where nothing is said


def shown_artifacts(outcome: Outcome, *, detailed: bool = False) -> list[str]:
    """Return the names of what was draped and of its body, or of what was scanned or fitted; garments first.

    Args:
        outcome: Of the run.
        detailed: Whether garments are shown as their render meshes, where there are any.
    """
    made = list(_made(outcome))
    draped = [name for name in made if name.endswith("draped")]
    if draped:
        if detailed:
            fine = [f"{name.removesuffix('draped')}render_mesh" for name in draped]
            draped = [rich if rich in made else plain for rich, plain in zip(fine, draped, strict=True)]
        return draped + [name for name in made if name.endswith("collider")][:1]
    return [name for name in _ALONE if name in made][:1]


def shown_meshes(name: str, value: Any) -> list[TriangleMesh]:
    """Return the surfaces of an artifact; the body under a garment in a colour of its own."""
    if isinstance(value, TriangleMesh):
        return [value]
    if isinstance(value, tuple):
        return [painted(part) for part in value if part.name != BODY]
    return [tint(value.final, SKIN)] if name.endswith("collider") else [value.mesh]


def shown_surfaces(outcome: Outcome) -> list[TriangleMesh]:
    """Return the surfaces of a run in full detail, garments first; a lifelike body as cloth lies on it."""
    names = shown_artifacts(outcome, detailed=True)
    if outcome.made("lifelike_body") and any(name.endswith("render_mesh") for name in names):
        return [painted(part) for part in shown_parts(outcome)]
    return [mesh for name in names for mesh in shown_meshes(name, outcome.read(name))]


def shown_parts(outcome: Outcome) -> list[GlbPart]:
    """Return the parts of a run's render meshes, of all its garments, and their body once.

    Raises:
        InputError: it made none.
    """
    found = {
        name.removesuffix("render_mesh").rstrip("_"): outcome.read(name)
        for name in shown_artifacts(outcome, detailed=True)
        if name.endswith("render_mesh")
    }
    if not found:
        raise InputError(
            "this run made no render mesh", where=str(outcome.folder), hint="`want: [render_mesh]`, or a drape"
        )
    return list(found[""]) if "" in found else joined_parts(found)


def _made(outcome: Outcome) -> Iterator[str]:
    for kind in outcome.tables.kinds:
        if kind.filename and outcome.made(kind.name):
            yield kind.name


def painted(part: GlbPart) -> TriangleMesh:
    """Return the mesh of a part with its picture, or its colour, on it."""
    if part.texture is None or part.uv is None:
        if part.mesh.colors is not None or part.base_color[:3] == _UNDYED:
            return part.mesh
        red, green, blue = (int(value) for value in encode_srgb(np.array(part.base_color[:3])))
        return tint(part.mesh, (red, green, blue))
    places = part.uv[part.mesh.faces] * (1.0, -1.0) + (0.0, 1.0)  # glTF counts v downward
    return replace(part.mesh, skin=Skin(places, part.texture))
