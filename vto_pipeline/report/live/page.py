"""The page that shows what moves now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.report.document import asset, document
from vto_pipeline.report.layers import PageLayer
from vto_pipeline.report.live.codec import STEP_M
from vto_pipeline.report.packing import PackedMesh, pack
from vto_pipeline.report.scene import build_page_scene, script_json

_TRIANGLES = 20_000  # of one mesh: twice as many bytes a frame as it is, and no finer on a screen


@dataclass(frozen=True)
class LivePage:
    """A page, and what its frames are made of.

    Args:
        html: The page.
        sources: For each mesh, in order, which vertices of it are shown; their places make a frame, shape (V,) each.
    """

    html: str
    sources: tuple[NDArray[np.integer], ...]


def live_page(title: str, layers: Sequence[PageLayer]) -> LivePage:
    """Return the page.

    Args:
        title: For people.
        layers: What is shown, the body last; a mesh each.
    """
    packed = [pack(layer.mesh, len(layer.mesh.faces) if layer.skin else _TRIANGLES) for layer in layers]
    scene = build_page_scene([_thinned(layer, one) for layer, one in zip(layers, packed, strict=True)])
    scene["live"] = {"step": STEP_M, "counts": [len(one.source) for one in packed]}
    html = document("live/live.html", title=title, scene=script_json(scene), live=asset("live/live.js"))
    return LivePage(html, tuple(one.source for one in packed))


def _thinned(layer: PageLayer, packed: PackedMesh) -> PageLayer:
    """Return the layer with the vertices that are shown."""
    paint, skin = layer.paint, layer.skin
    if not isinstance(paint, str):
        paint = paint[packed.source]
    if skin is not None and skin.uv is not None:
        skin = replace(skin, mesh=packed.mesh, uv=skin.uv[packed.source])
    return replace(layer, mesh=packed.mesh, paint=paint, skin=skin)
