"""The 3D view's data: meshes and colours as plain JSON values."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from vto_pipeline.report.layers import PageLayer
from vto_pipeline.report.packing import pack, pack_colors, pack_picture, pack_places

_TRIANGLES = 60_000  # of one mesh
_TRIANGLES_ALL = 240_000  # of all meshes; keeps the page under 8 MB


def build_page_scene(layers: Sequence[PageLayer], frame_time: float | None = None) -> dict[str, Any]:
    """Return geometries, layers that refer to them by number, and the time between frames of those that move [s].

    A mesh that several layers show is packed once. The first layer of each group starts visible, a scan only when there
    is nothing else: what was made from it lies in the same place. A mesh with a picture keeps its triangles.
    """
    meshes = {id(layer.mesh): layer.mesh for layer in layers}
    whole = {id(layer.mesh) for layer in layers if layer.skin is not None}
    budget = min(_TRIANGLES, _TRIANGLES_ALL // max(len(meshes), 1))
    packed = {key: pack(mesh, len(mesh.faces) if key in whole else budget) for key, mesh in meshes.items()}
    frames = {id(layer.mesh): layer.frames for layer in layers if layer.frames is not None}
    numbers = {key: number for number, key in enumerate(packed)}
    groups: set[str] = set()
    described = []
    for layer in layers:
        visible = layer.group not in groups and not (layer.group == "scan" and groups)
        groups.add(layer.group)
        if isinstance(layer.paint, str):
            paint: dict[str, Any] = {"color": layer.paint}
        else:
            paint = {"colors": pack_colors(layer.paint[packed[id(layer.mesh)].source])}
        if layer.skin is not None and layer.skin.uv is not None and layer.skin.texture is not None:
            paint |= pack_places(layer.skin.uv[packed[id(layer.mesh)].source])
            paint["picture"] = pack_picture(layer.skin.texture)
        described.append(
            {
                "name": layer.name,
                "group": layer.group,
                "geometry": numbers[id(layer.mesh)],
                "visible": visible,
                "legend": None if layer.scale is None else layer.scale.legend(),
                **paint,
            }
        )
    geometries = [one.moving_geometry(frames[key]) if key in frames else one.geometry() for key, one in packed.items()]
    return {"geometries": geometries, "layers": described, "frameTime": frame_time}


def script_json(value: Any) -> str:
    """Return JSON that cannot end the script element it stands in, whatever the strings in it."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"), sort_keys=True)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
