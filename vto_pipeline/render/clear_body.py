"""No vertex of what is worn inside the body.

A simulation holds its own vertices and triangles outside. A finer surface that follows them cuts their corners, and a
thinned one its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.render.dress import BODY

_CLEAR = 0.0005
"""So far outside of the body garments are held [m]: more than the half step by which a file rounds."""

_ROUNDS = 8
"""Of moving vertices out of the body; in a crease one face's outside may be another's inside."""


def clear_body(parts: Sequence[GlbPart]) -> tuple[list[GlbPart], int]:
    """Move what lies inside the body, or all but touches it, just outside.

    Args:
        parts: One of them may be the body; without it they stay as they are.

    Returns:
        The parts, and how many vertices were moved.
    """
    bodies = [part.mesh for part in parts if part.name == BODY]
    if not bodies:
        return list(parts), 0
    worn = [part.mesh.vertices for part in parts if part.name != BODY]
    cleared = iter(outside(worn, concatenate(bodies)))
    found = [
        part if part.name == BODY else replace(part, mesh=replace(part.mesh, vertices=next(cleared))) for part in parts
    ]
    pairs = zip(parts, found, strict=True)
    return found, sum(int((new.mesh.vertices != old.mesh.vertices).any(axis=1).sum()) for old, new in pairs)


def outside(worn: Sequence[FloatArray], body: TriangleMesh) -> list[FloatArray]:
    """Return vertices, each of shape (V, 3), those inside the body or all but touching it moved just outside [m]."""
    distance, outward = SurfaceDistance(body), face_normals(body)
    cleared = []
    for before in worn:
        vertices = np.array(before)
        for _ in range(_ROUNDS):
            found = distance.signed(vertices)
            close = found.distance < 0.5 * _CLEAR
            if not close.any():
                break
            vertices[close] = found.point[close] + _CLEAR * outward[found.face[close]]
        cleared.append(vertices)
    return cleared
