"""The README's picture: the input, the scan, and the garment on the customer."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vto_pipeline.io.captures.images import read_image
from vto_pipeline.io.gltf.write import read_glb
from vto_pipeline.io.meshes import read_own_mesh
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.render.frames import frame_view
from vto_pipeline.render.pictures import render_picture
from vto_pipeline.render.tint import SKIN, tint

_HEIGHT = 600


def draw_demo(run: Path, samples: Path) -> ByteArray:
    """One row: a photo, the garment from front and back, and the dressed customer from front and back.

    Args:
        run: A run of configs/demo.yaml.
        samples: The sample data's folder.

    Returns:
        sRGB picture, shape (600, W, 3).
    """
    out = run / "out"
    photo = read_image(samples / "shirt_on_form" / "photos" / "IMG_0001.jpg")
    garment = read_own_mesh(out / "garment.ply")
    dressed = [tint(read_own_mesh(out / "avatar.ply"), SKIN), read_glb(out / "render_mesh.glb")[0].mesh]
    columns = [photo[:, 130:670]]
    for shown, width in (([garment], 480), (dressed, 420)):
        columns += [render_picture(shown, frame_view(name, shown), size=(width, _HEIGHT)) for name in ("front", "back")]
    return np.hstack(columns)
