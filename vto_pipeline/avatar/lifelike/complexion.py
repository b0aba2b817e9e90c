"""Colours of skin, hair and eyes, vertex by vertex."""

from __future__ import annotations

import numpy as np

from vto_pipeline.geometry.smooth import smooth_values
from vto_pipeline.model.arrays import ByteArray, FloatArray, IntArray
from vto_pipeline.model.body import MorphableBody
from vto_pipeline.model.mesh import TriangleMesh

_HAIRLINE = np.array(
    [(0.0, -0.22), (0.28, -0.20), (0.40, 0.02), (0.46, 0.11), (0.62, 0.11), (0.72, 0.17), (0.90, 0.28)]
)
"""Height of the hairline above the eyes, from the back of the head to its front, both in heights of the head."""
_SOFT, _ROUNDS = 0.06, 2
"""Over which hair thins out, in heights of the head; rounds of smoothing its edge."""
_BROW = (0.085, 0.016, 0.7)
"""Height of the brows above the eyes and half their breadth, in heights of the head; how much hair they have."""
_FACE = 0.75
"""Where the face begins, from the back of the head to its front."""
_IRIS, _PUPIL = 0.5, 0.25
"""Radii on an eye, in its own radius."""
_WHITE, _IRIS_COLOR, _BLACK = (236, 232, 226), (92, 74, 58), (18, 16, 16)
"""Colours of an eye, sRGB."""


def colors_of(
    body: MorphableBody, vertices: FloatArray, skin: tuple[int, int, int], hair: tuple[int, int, int] | None
) -> ByteArray:
    """Return the colour of each vertex, sRGB, shape (V, 3).

    Args:
        body: Whose groups and named points these are.
        vertices: Blended, at rest [m], shape (V, 3).
        skin: sRGB.
        hair: sRGB of short hair; None: the head is shaved.
    """
    colors = np.tile(np.array(skin, dtype=float), (len(vertices), 1))
    if hair is not None:
        share = _hair_share(body, vertices)[:, None]
        colors += share * (np.array(hair) - colors)
    for side in ("left", "right"):
        own = np.unique(body.surfaces[f"{side} eye"])
        colors[own] = _eye(vertices[own])
    return np.rint(colors).astype(np.uint8)


def _hair_share(body: MorphableBody, vertices: FloatArray) -> FloatArray:
    """Return how much of each vertex hair covers, 0 to 1."""
    eyes = (_place(body, vertices, "l-eye") + _place(body, vertices, "r-eye")) / 2
    eyes_apart = abs(_place(body, vertices, "l-eye")[0])
    used = np.unique(body.surfaces["body"])
    top = vertices[used, 1].max()
    tall = 2 * (top - eyes[1])  # eyes are half way up a head
    height = (vertices[:, 1] - eyes[1]) / tall
    skull = used[height[used] > 0.15]
    back, front = vertices[skull, 2].min(), vertices[skull, 2].max()
    ahead = (vertices[:, 2] - back) / (front - back)
    share = np.clip((height - np.interp(ahead, *_HAIRLINE.T)) / _SOFT, 0.0, 1.0)
    share = smooth_values(TriangleMesh(vertices, body.surfaces["body"]), share, _ROUNDS)
    aside, over = np.abs(vertices[:, 0]) / eyes_apart, (height - _BROW[0]) / _BROW[1]
    brow = np.exp(-(((aside - 1.12) / 0.55) ** 4) - (over - 0.45 * (aside - 1.0) + 0.5 * (aside - 1.2) ** 2) ** 2)
    brow *= ahead > _FACE
    return np.maximum(share, _BROW[2] * brow)


def _eye(points: FloatArray) -> FloatArray:
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = np.ptp(points, axis=0).max() / 2
    off = np.linalg.norm((points - middle)[:, :2], axis=1) / radius
    front = points[:, 2] > middle[2]
    colors = np.tile(np.array(_WHITE, dtype=float), (len(points), 1))
    colors[front & (off < _IRIS)] = _IRIS_COLOR
    colors[front & (off < _PUPIL)] = _BLACK
    return colors


def _place(body: MorphableBody, vertices: FloatArray, name: str) -> FloatArray:
    place: IntArray = body.places[name]
    middle: FloatArray = vertices[place].mean(axis=0)
    return middle
