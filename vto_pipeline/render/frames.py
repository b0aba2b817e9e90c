"""What a picture frames, and from where: named views, and turns about the upright."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

FRONT, LEFT, BACK = 0.0, 90.0, 180.0
"""Where the viewer stands [deg]: before the person, at the person's left, behind."""

VIEWS = ("front", "side", "back", "closeup")
"""Names of views; a close-up shows the upper part of the first mesh."""

ELEVATION = 5.0
"""How far the viewer looks down [deg]."""

_CLOSE_AZIMUTH = 25.0
_CLOSE_HEIGHT, _CLOSE_SIZE = 0.7, 0.25  # where a close-up looks, and half of what it shows, as shares of the height


class Frame(NamedTuple):
    """A part of space that fills a picture.

    Args:
        middle: Of the picture [m], shape (3,).
        half: Half of its least width and height [m].
        azimuth_deg: Where the viewer stands, 0 in front (+Z), 90 at the person's left (+X) [deg].
        elevation_deg: How far the viewer looks down [deg].
    """

    middle: FloatArray
    half: tuple[float, float]
    azimuth_deg: float = FRONT
    elevation_deg: float = ELEVATION

    @property
    def axes(self) -> FloatArray:
        """Right, up and towards the viewer, as rows, shape (3, 3)."""
        a, e = np.radians([self.azimuth_deg, self.elevation_deg])
        right = np.array([np.cos(a), 0.0, -np.sin(a)])
        towards = np.array([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])
        return np.stack([right, np.cross(towards, right), towards])


def frame_box(low: FloatArray, high: FloatArray, azimuth_deg: float = FRONT, elevation_deg: float = ELEVATION) -> Frame:
    """Return the frame that a box fills; its corners are [m], shape (3,)."""
    middle, size = 0.5 * (low + high), 0.5 * (high - low)
    axes = Frame(middle, (0.0, 0.0), azimuth_deg, elevation_deg).axes
    width, height = np.abs(axes[:2]) @ size
    return Frame(middle, (float(width), float(height)), azimuth_deg, elevation_deg)


def frame_view(name: str, meshes: Sequence[TriangleMesh]) -> Frame:
    """Return the frame of a named view; see `VIEWS`.

    Args:
        name: Of the view.
        meshes: What is shown, what matters most first.
    """
    if name == "closeup":
        low, high = bounds(meshes[:1])
        tall = high[1] - low[1]
        middle = np.array([0.5 * (low[0] + high[0]), low[1] + _CLOSE_HEIGHT * tall, 0.5 * (low[2] + high[2])])
        return Frame(middle, (_CLOSE_SIZE * tall, _CLOSE_SIZE * tall), _CLOSE_AZIMUTH)
    return frame_box(*bounds(meshes), {"front": FRONT, "side": LEFT, "back": BACK}[name])


def frame_turn(meshes: Sequence[TriangleMesh], count: int) -> list[Frame]:
    """Return the frames of a turn about the upright through their middle, all of one size."""
    low, high = bounds(meshes)
    middle = 0.5 * (low + high)
    used = np.vstack([mesh.vertices[mesh.faces.ravel()] for mesh in meshes])
    reach = float(np.linalg.norm(used[:, [0, 2]] - middle[[0, 2]], axis=1).max())
    e = np.radians(ELEVATION)
    half = (reach, float(0.5 * (high[1] - low[1]) * np.cos(e) + reach * np.sin(e)))
    return [Frame(middle, half, 360.0 * k / count) for k in range(count)]


def bounds(meshes: Sequence[TriangleMesh]) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest corner of the box about what meshes use [m], each of shape (3,)."""
    used = [m.vertices[m.faces.ravel()] for m in meshes]
    return np.min([u.min(axis=0) for u in used], axis=0), np.max([u.max(axis=0) for u in used], axis=0)
