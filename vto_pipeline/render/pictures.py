"""Pictures of meshes without a display."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.arrays import ByteArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.frames import Frame, bounds, frame_box
from vto_pipeline.render.pixels import SAMPLES, View, draw_pixels
from vto_pipeline.render.shading import KEY_LIGHT, surroundings
from vto_pipeline.render.shadows import no_shadows, shadow_map
from vto_pipeline.render.surface_colors import paint_of

_FLOOR = 20.0  # times the scene's size: so far the ground reaches


def render_picture(
    meshes: Sequence[TriangleMesh],
    frame: Frame | None = None,
    *,
    size: tuple[int, int] = (600, 800),
    margin: float = 0.05,
    shadows: bool = False,
) -> ByteArray:
    """Draw meshes in parallel projection, upright, filling the picture.

    Args:
        meshes: What to draw, at least one; a picture on them or vertex colours are used where there are any.
        frame: What to frame, and from where; default all of it, from the front.
        size: Width and height [px].
        margin: Share of the picture left empty on each side.
        shadows: Whether what is drawn throws soft shadows, also on a ground under it.

    Returns:
        sRGB on white, shape (height, width, 3).
    """
    frame = frame_box(*bounds(meshes)) if frame is None else frame
    faces, axes = concatenate(meshes).faces, frame.axes
    placed = (np.vstack([mesh.vertices for mesh in meshes]) - frame.middle) @ axes.T  # in the viewer's frame [m]
    normals = np.vstack([vertex_normals(mesh) for mesh in meshes]) @ axes.T
    width, height = SAMPLES * size[0], SAMPLES * size[1]
    per_metre = (1 - 2 * margin) * min(0.5 * width / frame.half[0], 0.5 * height / frame.half[1])
    to_image = per_metre * np.array([1.0, -1.0, -1.0])  # rows run down, depth runs away
    middle = np.array([0.5 * (width - 1), 0.5 * (height - 1), 0.0])
    corners = (placed * to_image + middle)[faces]
    around, step = surroundings(corners, width, height)
    up = np.ascontiguousarray(axes[:, 1])
    level, far = float((placed @ up).min()), _FLOOR * float(np.ptp(placed, axis=0).max())
    view = View(corners, normals[faces], to_image, middle, around, step, up, level, far)
    shadow = shadow_map(placed[faces], KEY_LIGHT) if shadows else no_shadows()
    picture: ByteArray = draw_pixels(view, paint_of(meshes), shadow, *size)
    return picture
