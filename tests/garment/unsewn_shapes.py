"""Surfaces whose flat shape is known in closed form, and their fabrics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vto_pipeline.io.fabrics import read_fabric
from vto_pipeline.model.mesh import TriangleMesh

POPLIN = read_fabric("cotton_poplin")
EVEN = replace(POPLIN, stretch_warp=1000.0, stretch_weft=1000.0, shear=500.0, poisson=0.0)
"""An isotropic sheet: its shear modulus is half of its Young's modulus, as Poisson's ratio is none."""


def frustum(low: float, high: float, height: float, around: int = 96, up: int = 20) -> TriangleMesh:
    """A cone's part between two radii [m], upright about the y axis, outward; a tube if they are equal."""
    angle = 2.0 * np.pi * np.arange(around) / around
    share = np.linspace(0.0, 1.0, up + 1)
    radius = (1.0 - share) * low + share * high
    x, z = (radius[:, None] * f(angle) for f in (np.sin, np.cos))
    vertices = np.stack([x, np.broadcast_to((height * share)[:, None], x.shape), z], axis=2).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(up), np.arange(around), indexing="ij")
    a, b = row * around + column, row * around + (column + 1) % around
    c, d = a + around, b + around
    faces = np.stack([np.stack([a, b, d], axis=2), np.stack([a, d, c], axis=2)], axis=2).reshape(-1, 3)
    return TriangleMesh(vertices, faces.astype(np.int32))


def cap(radius: float, reach: float, rings: int = 24) -> TriangleMesh:
    """A sphere's part within a geodesic distance of its pole [m], in hexagonal rings, outward about +Z."""
    points, start = [np.zeros(2)], [0]
    for k in range(1, rings + 1):
        start.append(len(points))
        angle = 2.0 * np.pi * np.arange(6 * k) / (6 * k)
        points += list(reach * k / rings * np.column_stack([np.cos(angle), np.sin(angle)]))
    faces = [(0, 1 + k, 1 + (k + 1) % 6) for k in range(6)]
    for ring in range(2, rings + 1):
        inner, outer = start[ring - 1], start[ring]
        i = o = 0
        while i < 6 * (ring - 1) or o < 6 * ring:
            a, b = inner + i % (6 * (ring - 1)), outer + o % (6 * ring)
            if (o + 1) * (ring - 1) <= (i + 1) * ring:
                faces.append((a, b, outer + (o + 1) % (6 * ring)))
                o += 1
            else:
                faces.append((a, b, inner + (i + 1) % (6 * (ring - 1))))
                i += 1
    flat = np.array(points)
    arc = np.linalg.norm(flat, axis=1) / radius
    way = flat / np.maximum(np.linalg.norm(flat, axis=1), 1e-12)[:, None]
    vertices = radius * np.column_stack([np.sin(arc)[:, None] * way, np.cos(arc)])
    return TriangleMesh(vertices, np.array(faces, dtype=np.int32))
