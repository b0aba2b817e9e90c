"""Shapes with known girths, areas and distances."""

from __future__ import annotations

import numpy as np

from vto_pipeline.model.mesh import TriangleMesh


def tube(radius_x: float, radius_z: float, low: float, high: float, around: int = 256, rings: int = 9) -> TriangleMesh:
    """An open elliptic tube about the +Y axis, oriented outward, its vertices on the ellipse."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack([radius_x * np.sin(angle), np.zeros(around), radius_z * np.cos(angle)], axis=1)
    heights = np.linspace(low, high, rings)
    vertices = (ring[None] + heights[:, None, None] * [0.0, 1.0, 0.0]).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    quads = np.stack([a, b, b + around, a, b + around, a + around], axis=-1)
    return TriangleMesh(vertices, quads.reshape(-1, 3))


def sphere(radius: float, rings: int = 64) -> TriangleMesh:
    """A closed sphere about the origin, oriented outward, its vertices on the sphere."""
    around = 2 * rings
    polar = np.pi * np.arange(1, rings) / rings
    angle = 2 * np.pi * np.arange(around) / around
    band = np.stack(
        [
            np.outer(np.sin(polar), np.sin(angle)),
            np.outer(np.cos(polar), np.ones(around)),
            np.outer(np.sin(polar), np.cos(angle)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = radius * np.vstack([band, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    i, j = np.meshgrid(np.arange(rings - 2), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    quads = np.stack([a, b + around, b, a, a + around, b + around], axis=-1).reshape(-1, 3)
    k = np.arange(around)
    top, bottom, last = len(band), len(band) + 1, (rings - 2) * around
    caps = [
        np.stack([np.full(around, top), k, (k + 1) % around], axis=1),
        np.stack([np.full(around, bottom), last + (k + 1) % around, last + k], axis=1),
    ]
    return TriangleMesh(vertices, np.vstack([quads, *caps]))


def shifted(mesh: TriangleMesh, offset: tuple[float, float, float]) -> TriangleMesh:
    """The mesh elsewhere."""
    return TriangleMesh(mesh.vertices + np.asarray(offset), mesh.faces)
