"""A small picture of what a run made, drawn once for the same content."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vto_pipeline.errors import VtoError
from vto_pipeline.io.files import replacing
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.pipeline.execution.digest import digest_file, digest_value
from vto_pipeline.stages.entry.outcome import Outcome

PICTURES = "pictures"
_SIZE = (144, 192)  # px: twice that of its place on the page
_BODY = np.array([168, 142, 124], dtype=np.uint8)
_ALONE = ("garment", "garment_surface", "avatar", "fitted_avatar", "body_surface", "mannequin_surface", "surface")
"""What is shown of a run without a drape: the first of these that it made."""


def draw_outcome(outcome: Outcome, folder: Path) -> str:
    """Draw what was draped on its body, or what was scanned or fitted, seen from the front.

    Args:
        outcome: Of the run.
        folder: BATCH; the picture lies in its folder `pictures`, under a name that its content decides.

    Returns:
        Path in BATCH; empty where the run made nothing that can be drawn.
    """
    from PIL import Image

    from vto_pipeline.render.pictures import render_picture

    shown = _shown(outcome)
    if not shown:
        return ""
    digests = {name: digest_file(outcome.path(name)) for name in shown}
    address = f"{PICTURES}/{digest_value({'size': _SIZE, 'shown': digests})[:24]}.png"
    path = folder / address
    if not path.is_file():
        try:
            meshes = [_mesh(name, outcome.read(name)) for name in shown]
        except VtoError:
            return ""  # damaged since; the row is what it is without its picture
        used = np.vstack([mesh.vertices[mesh.faces.ravel()] for mesh in meshes])
        if len(used) == 0 or not np.ptp(used[:, :2], axis=0).all():
            return ""  # nothing, or a sheet seen from its edge
        picture = render_picture(meshes, size=_SIZE)
        path.parent.mkdir(exist_ok=True)
        with replacing(path) as beside:
            Image.fromarray(picture).save(beside, format="png", optimize=True)
    return address


def _shown(outcome: Outcome) -> list[str]:
    made = list(_made(outcome))
    draped = [name for name in made if name.endswith("draped")]
    if draped:
        return draped + [name for name in made if name.endswith("collider")][:1]
    return [name for name in _ALONE if name in made][:1]


def _made(outcome: Outcome) -> Iterator[str]:
    for kind in outcome.tables.kinds:
        with suppress(VtoError):
            if kind.filename and outcome.made(kind.name):
                yield kind.name


def _mesh(name: str, value: Any) -> TriangleMesh:
    """Return the surface of an artifact; the body under a garment in a colour of its own."""
    if isinstance(value, TriangleMesh):
        return value
    mesh: TriangleMesh = value.final if name.endswith("collider") else value.mesh
    return replace(mesh, colors=np.broadcast_to(_BODY, mesh.vertices.shape)) if name.endswith("collider") else mesh
