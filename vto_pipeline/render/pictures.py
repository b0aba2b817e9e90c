"""Pictures of meshes without a display."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.render.shading import crevices, matt_brightness

FRONT, LEFT, BACK = 0.0, 90.0, 180.0
"""Where the viewer stands [deg]: before the person, at the person's left, behind."""

_SAMPLES = 2  # per pixel and direction
_CLOTH = np.array([205, 206, 203], dtype=np.uint8)
_PAPER = 255.0


def render_picture(
    meshes: Sequence[TriangleMesh],
    *,
    azimuth_deg: float = FRONT,
    elevation_deg: float = 5.0,
    size: tuple[int, int] = (600, 800),
    margin: float = 0.05,
    box: tuple[FloatArray, FloatArray] | None = None,
) -> ByteArray:
    """Draw meshes in parallel projection, upright, filling the picture.

    Args:
        meshes: What to draw, at least one; vertex colours are used where there are any.
        azimuth_deg: Where the viewer stands, 0 in front (+Z), 90 at the person's left (+X) [deg].
        elevation_deg: How far the viewer looks down [deg].
        size: Width and height [px].
        margin: Share of the picture left empty on each side.
        box: Lowest and highest corner [m] to frame, each of shape (3,); default that of the meshes.

    Returns:
        sRGB on white, shape (height, width, 3).
    """
    width, height = _SAMPLES * size[0], _SAMPLES * size[1]
    view = _view_axes(azimuth_deg, elevation_deg)
    low, high = box or _bounds(meshes)
    half = 0.5 * np.abs(view[:2]) @ (high - low)
    pixels_per_metre = (1 - 2 * margin) * min(0.5 * width / half[0], 0.5 * height / half[1])
    whole = concatenate(meshes)
    normals = np.vstack([vertex_normals(m) for m in meshes]) @ view.T
    colors = np.vstack([np.broadcast_to(_CLOTH, m.vertices.shape) if m.colors is None else m.colors for m in meshes])

    to_image = pixels_per_metre * np.array([1.0, -1.0, -1.0])  # rows run down, depth runs away
    middle = np.array([0.5 * (width - 1), 0.5 * (height - 1), 0.0])
    corners = (((whole.vertices - 0.5 * (low + high)) @ view.T) * to_image + middle)[whole.faces]
    face, weight, depth = rasterise(corners, width, height)

    seen = face >= 0
    shown = face[seen]
    share = np.column_stack([1 - weight[seen].sum(axis=1), weight[seen]])[:, None, :]
    u, v = corners[shown, 1, :2] - corners[shown, 0, :2], corners[shown, 2, :2] - corners[shown, 0, :2]
    far_side = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0  # rows run down, so outer sides run clockwise
    normal, color = ((share @ values[whole.faces[shown]])[:, 0] for values in (normals, colors.astype(np.float64)))
    brightness = matt_brightness(normal, far_side) * crevices(depth / pixels_per_metre)[seen]
    picture = np.full((height, width, 3), _PAPER)
    picture[seen] = color * brightness[:, None]
    averaged = picture.reshape(size[1], _SAMPLES, size[0], _SAMPLES, 3).mean(axis=(1, 3))
    return np.rint(averaged).astype(np.uint8)


def _view_axes(azimuth_deg: float, elevation_deg: float) -> FloatArray:
    """Right, up and towards the viewer, as rows, shape (3, 3)."""
    a, e = np.radians([azimuth_deg, elevation_deg])
    right = np.array([np.cos(a), 0.0, -np.sin(a)])
    towards = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
    return np.stack([right, np.cross(towards, right), towards])


def _bounds(meshes: Sequence[TriangleMesh]) -> tuple[FloatArray, FloatArray]:
    used = [m.vertices[m.faces.ravel()] for m in meshes]
    return np.min([u.min(axis=0) for u in used], axis=0), np.max([u.max(axis=0) for u in used], axis=0)
