"""Pictures of meshes without a display."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vto_pipeline.geometry.topology import concatenate, vertex_normals
from vto_pipeline.model.arrays import ByteArray, FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.numerics.rasterise import rasterise
from vto_pipeline.render.frames import Frame, bounds, frame_box
from vto_pipeline.render.shading import KEY_LIGHT, crevices, matt_brightness
from vto_pipeline.render.shadows import ShadowMap
from vto_pipeline.render.surface_colors import surface_colors

_SAMPLES = 2  # per pixel and direction
_BAND = 128  # rows of pixels at a time, so that what is at work stays in the cache
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
    frame = frame_box(*bounds(meshes)) if frame is None else frame
    scene = _Scene(meshes, frame, (_SAMPLES * size[0], _SAMPLES * size[1]), margin, shadows=shadows)
    picture = np.empty((size[1], size[0], 3), np.uint8)
    for first in range(0, size[1], _BAND):
        band = scene.rows(_SAMPLES * first, _SAMPLES * min(first + _BAND, size[1]))
        averaged = band.reshape(-1, _SAMPLES, size[0], _SAMPLES, 3).mean(axis=(1, 3))
        picture[first : first + _BAND] = np.rint(averaged)
    return picture


class _Scene:
    """Meshes seen in a frame.

    Args:
        meshes: What is drawn.
        frame: What is framed, and from where.
        size: Width and height in samples.
        margin: Share left empty on each side.
        shadows: Whether there are any.
    """

    def __init__(
        self, meshes: Sequence[TriangleMesh], frame: Frame, size: tuple[int, int], margin: float, *, shadows: bool
    ) -> None:
        width, height = size
        self._meshes, self._faces = meshes, concatenate(meshes).faces
        view = frame.axes
        self._normals = np.vstack([vertex_normals(m) for m in meshes]) @ view.T
        self._placed = (np.vstack([m.vertices for m in meshes]) - frame.middle) @ view.T  # in the viewer's frame [m]
        per_metre = (1 - 2 * margin) * min(0.5 * width / frame.half[0], 0.5 * height / frame.half[1])
        self._to_image = per_metre * np.array([1.0, -1.0, -1.0])  # rows run down, depth runs away
        self._middle = np.array([0.5 * (width - 1), 0.5 * (height - 1), 0.0])
        self._corners = (self._placed * self._to_image + self._middle)[self._faces]
        self._face, self._weight, depth = rasterise(self._corners, width, height)
        self._crevices = crevices(depth / per_metre)
        self._up = view[:, 1]  # the upright, in the viewer's frame
        self._shadow = ShadowMap(self._placed[self._faces], KEY_LIGHT) if shadows else None

    def rows(self, begin: int, end: int) -> FloatArray:
        """Return some rows, sRGB 0 to 255, shape (end - begin, width, 3)."""
        face, weight = self._face[begin:end], self._weight[begin:end]
        seen = face >= 0
        shown = face[seen]
        share = np.column_stack([1 - weight[seen].sum(axis=1), weight[seen]])
        corners = self._corners[shown, :, :2]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        far_side = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0  # rows run down, so outer sides run clockwise
        normal = _blend(share, self._normals[self._faces[shown]])
        lit = np.ones(len(shown))
        picture = np.full((*face.shape, 3), _PAPER)
        if self._shadow is not None:
            lit = self._shadow.lit(_blend(share, self._placed[self._faces[shown]]), normal)
            ground, places = self._ground(seen, begin)
            dark = 1.0 - self._shadow.lit(places, np.broadcast_to(self._up, places.shape))
            picture[ground] = (_PAPER * (1.0 - _SHADE * dark))[:, None]
        brightness = matt_brightness(normal, far_side, lit) * self._crevices[begin:end][seen]
        picture[seen] = _colors(self._meshes, shown, share) * brightness[:, None]
        return picture

    def _ground(self, seen: NDArray[np.bool_], begin: int) -> tuple[NDArray[np.bool_], FloatArray]:
        """Return which pixels show the ground, and its places there, in the viewer's frame.

        Args:
            seen: Pixels of some rows that show something else, shape (R, W).
            begin: The first of these rows.
        """
        up = self._up
        if up[2] <= 0.0:  # from below, or along it, no ground is seen
            return np.zeros_like(seen), np.empty((0, 3))
        level = (self._placed @ up).min()
        rows, columns = np.nonzero(~seen)
        flat = (np.column_stack([columns, rows + begin]) - self._middle[:2]) / self._to_image[:2]
        towards = (level - flat @ up[:2]) / up[2]
        near = np.abs(towards) < _FLOOR * np.ptp(self._placed, axis=0).max()
        ground = np.zeros_like(seen)
        ground[rows[near], columns[near]] = True
        return ground, np.column_stack([flat[near], towards[near]])


def _blend(share: FloatArray, values: FloatArray) -> FloatArray:
    """Return sums of corners' values (N, 3, K) by their shares (N, 3)."""
    blended: FloatArray = np.einsum("nc,nck->nk", share, values)
    return blended


def _colors(meshes: Sequence[TriangleMesh], shown: NDArray[np.int32], share: FloatArray) -> FloatArray:
    """Return the colour of each place on the meshes' triangles, numbered through, shape (N, 3)."""
    colors, first = np.empty((len(shown), 3)), 0
    for mesh in meshes:
        own = (shown >= first) & (shown < first + len(mesh.faces))
        colors[own] = surface_colors(mesh, shown[own] - first, share[own])
        first += len(mesh.faces)
    return colors
