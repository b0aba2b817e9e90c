"""Pictures of meshes without a display."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.render.frames import Frame, bounds, frame_box
from vto_pipeline.render.shading import KEY_LIGHT, crevices, matt_brightness
from vto_pipeline.render.shadows import lit_share
from vto_pipeline.render.surface_colors import surface_colors

_SAMPLES = 2  # per pixel and direction
_PAPER = 255.0
_SHADE = 0.35  # what the ground loses where the light does not reach it
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
    width, height = _SAMPLES * size[0], _SAMPLES * size[1]
    frame = frame_box(*bounds(meshes)) if frame is None else frame
    view, (half_width, half_height) = frame.axes, frame.half
    pixels_per_metre = (1 - 2 * margin) * min(0.5 * width / half_width, 0.5 * height / half_height)
    whole = concatenate(meshes)
    normals = np.vstack([vertex_normals(m) for m in meshes]) @ view.T

    to_image = pixels_per_metre * np.array([1.0, -1.0, -1.0])  # rows run down, depth runs away
    middle = np.array([0.5 * (width - 1), 0.5 * (height - 1), 0.0])
    placed = (whole.vertices - frame.middle) @ view.T
    corners = (placed * to_image + middle)[whole.faces]
    face, weight, depth = rasterise(corners, width, height)

    seen = face >= 0
    shown = face[seen]
    share = np.column_stack([1 - weight[seen].sum(axis=1), weight[seen]])
    u, v = corners[shown, 1, :2] - corners[shown, 0, :2], corners[shown, 2, :2] - corners[shown, 0, :2]
    far_side = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0  # rows run down, so outer sides run clockwise
    normal = np.einsum("nc,nck->nk", share, normals[whole.faces[shown]])
    lit = np.ones(len(shown))
    picture = np.full((height, width, 3), _PAPER)
    if shadows:
        at = np.einsum("nc,nck->nk", share, placed[whole.faces[shown]])
        lit = lit_share(placed[whole.faces], at, normal, KEY_LIGHT)
        ground, reached = _ground(placed, view, seen, (middle, to_image))
        upright = np.broadcast_to(view[:, 1], reached.shape)
        dark = 1.0 - lit_share(placed[whole.faces], reached, upright, KEY_LIGHT)
        picture[ground] = (_PAPER * (1.0 - _SHADE * dark))[:, None]
    brightness = matt_brightness(normal, far_side, lit) * crevices(depth / pixels_per_metre)[seen]
    picture[seen] = _colors(meshes, shown, share) * brightness[:, None]
    averaged = picture.reshape(size[1], _SAMPLES, size[0], _SAMPLES, 3).mean(axis=(1, 3))
    return np.rint(averaged).astype(np.uint8)


def _colors(meshes: Sequence[TriangleMesh], shown: np.ndarray, share: FloatArray) -> FloatArray:
    """Return the colour of each place on the meshes' triangles, numbered through, shape (N, 3)."""
    colors, first = np.empty((len(shown), 3)), 0
    for mesh in meshes:
        own = (shown >= first) & (shown < first + len(mesh.faces))
        colors[own] = surface_colors(mesh, shown[own] - first, share[own])
        first += len(mesh.faces)
    return colors


def _ground(
    placed: FloatArray, view: FloatArray, seen: np.ndarray, image: tuple[FloatArray, FloatArray]
) -> tuple[np.ndarray, FloatArray]:
    """Return the pixels that show the ground, shape (height, width), and its places there, in the viewer's frame.

    Args:
        placed: What stands on it, in the viewer's frame [m], shape (V, 3).
        view: The viewer's axes.
        seen: Pixels that show something else.
        image: Where the frame's middle is [px], and pixels per metre along the axes.
    """
    middle, to_image = image
    up = view[:, 1]  # the upright, in the viewer's frame
    if up[2] <= 0.0:  # from below, or along it, no ground is seen
        return np.zeros_like(seen), np.empty((0, 3))
    level = (placed @ up).min()
    rows, columns = np.nonzero(~seen)
    flat = (np.column_stack([columns, rows]) - middle[:2]) / to_image[:2]
    towards = (level - flat @ up[:2]) / up[2]
    near = np.abs(towards) < _FLOOR * np.ptp(placed, axis=0).max()
    ground = np.zeros_like(seen)
    ground[rows[near], columns[near]] = True
    return ground, np.column_stack([flat[near], towards[near]])
