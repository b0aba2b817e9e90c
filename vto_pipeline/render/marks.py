"""Marks of intersections in a picture."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.render.tint import MARK, Rgb, tint


def mark_places(points: FloatArray, radius: float = 0.008, color: Rgb = MARK) -> TriangleMesh:
    """Return a ball at each point, to be drawn with the meshes it concerns.

    Args:
        points: Places [m], shape (N, 3), N >= 1.
        radius: Of a ball [m].
        color: sRGB.
    """
    ball, faces = _ball()
    vertices = (points[:, None] + radius * ball).reshape(-1, 3)
    every = faces + len(ball) * np.arange(len(points))[:, None, None]
    return tint(TriangleMesh(vertices, every.reshape(-1, 3)), color)


def _ball(rings: int = 8, around: int = 12) -> tuple[FloatArray, IntArray]:
    """A unit sphere as a grid of latitudes, poles included, and longitudes."""
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    angle = 2 * np.pi * np.arange(around) / around
    grid = np.stack([np.sin(polar) * np.sin(angle), np.cos(polar) + 0 * angle, np.sin(polar) * np.cos(angle)], axis=-1)
    i, j = np.meshgrid(np.arange(rings), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    quads = np.stack([a, a + around, b + around, a, b + around, b], axis=-1)
    return grid.reshape(-1, 3), quads.reshape(-1, 3).astype(np.int32)
