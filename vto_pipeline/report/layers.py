"""Layers of the page's 3D view, from the artifacts of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.body import Avatar
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.report.body_loops import loop_ribbons
from vto_pipeline.report.render_colors import join_parts
from vto_pipeline.report.scales import CLEARANCE, SCAN, STRETCH, Key, Ramp

SKIN, CLOTH = "#d6b59c", "#6a8fc0"
_FORM, _MARK, _TAPE = "#b9b5ad", "#d62728", "#2f4b7c"
_GROUPS = ("garment", "body", "marks", "scan")
_PLAIN = (  # artifact, name, group, colour where it has none of its own
    ("render_mesh", "Garment", "garment", CLOTH),
    ("draped", "Simulated cloth", "garment", CLOTH),
    ("garment", "Garment as scanned", "garment", CLOTH),
    ("avatar", "Body", "body", SKIN),
    ("worn_by", "Body", "body", SKIN),
    ("mannequin_surface", "Mannequin", "body", _FORM),
    ("crossings", "Crossings", "marks", _MARK),
    ("garment_surface", "Garment scan", "scan", CLOTH),
    ("body_surface", "Body scan", "scan", SKIN),
)
_MOVING = (("Garment in motion", "garment", CLOTH), ("Body in motion", "body", SKIN))


@dataclass(frozen=True)
class PageLayer:
    """One thing that can be shown or hidden.

    Args:
        name: For people.
        mesh: Its shape.
        group: One of _GROUPS; of each one layer is shown at a time.
        paint: Colour of all, as #rrggbb, or of each vertex, shape (V, 3).
        skin: The part with the picture on it, where there is one; it has the mesh's vertices.
        scale: Explains the colours.
        frames: Where its vertices are in each frame of a motion [m], shape (T, V, 3); None where it stands still.
    """

    name: str
    mesh: TriangleMesh
    group: str
    paint: str | ByteArray
    scale: Ramp | Key | None = None
    skin: GlbPart | None = None
    frames: FloatArray | None = None


def list_layers(parts: Mapping[str, Any]) -> list[PageLayer]:
    """Return the layers that can be shown; the best of each group comes first.

    Args:
        parts: Artifact -> value; those that have no shape serve as colours or not at all.
    """
    layers = []
    for artifact, name, group, color in _PLAIN:
        if artifact in parts:
            mesh, skin = surface_of(parts[artifact]), skin_of(parts[artifact])
            layers.append(PageLayer(name, mesh, group, color if mesh.colors is None else mesh.colors, skin=skin))
    avatar = parts.get("avatar")
    if isinstance(avatar, Avatar) and avatar.loops:
        layers.append(PageLayer("Where it was measured", loop_ribbons(avatar), "marks", _TAPE))
    if "draped" in parts and "fit_maps" in parts:
        maps, draped = parts["fit_maps"], parts["draped"]
        layers.append(PageLayer("Stretch", draped, "garment", STRETCH.paint(100 * (maps["stretch"] - 1)), STRETCH))
        layers.append(PageLayer("Clearance", draped, "garment", CLEARANCE.paint(maps["clearance_mm"]), CLEARANCE))
    if "motion" in parts:
        for moving, (name, group, color) in zip(parts["motion"], _MOVING, strict=True):
            first = TriangleMesh(moving.frames[0], moving.faces)
            layers.append(PageLayer(name, first, group, color, frames=moving.frames))
            if group == "garment" and "motion_maps" in parts:
                most = STRETCH.paint(100 * (parts["motion_maps"]["stretch"] - 1))
                layers.append(PageLayer("Most stretch in motion", first, group, most, STRETCH, frames=moving.frames))
    if "garment_surface" in parts and "labels" in parts:
        surface = parts["garment_surface"]
        layers.append(PageLayer("Labels", surface, "scan", SCAN.paint(np.where(parts["labels"].garment, 0, 1)), SCAN))
    return sorted(layers, key=lambda layer: _GROUPS.index(layer.group))


def skin_of(value: Any) -> GlbPart | None:
    """Return the only part of a render mesh, if it has a picture."""
    if isinstance(value, TriangleMesh | Avatar) or len(value) != 1:
        return None
    return value[0] if value[0].texture is not None else None


def surface_of(value: TriangleMesh | Avatar | Sequence[GlbPart]) -> TriangleMesh:
    if isinstance(value, TriangleMesh):
        return value
    return value.mesh if isinstance(value, Avatar) else join_parts(value)
