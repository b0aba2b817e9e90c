"""A small picture of what a run made, drawn once for the same content."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.errors import VtoError
from vto_pipeline.io.files import replacing
from vto_pipeline.pipeline.execution.digest import digest_file, digest_value
from vto_pipeline.stages.entry.outcome import Outcome
from vto_pipeline.stages.entry.shown import shown_artifacts, shown_meshes

PICTURES = "pictures"
_SIZE = (144, 192)  # px: twice that of its place on the page


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

    shown = shown_artifacts(outcome)
    if not shown:
        return ""
    digests = {name: digest_file(outcome.path(name)) for name in shown}
    address = f"{PICTURES}/{digest_value({'size': _SIZE, 'shown': digests})[:24]}.png"
    path = folder / address
    if not path.is_file():
        try:
            meshes = [mesh for name in shown for mesh in shown_meshes(name, outcome.read(name))]
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
