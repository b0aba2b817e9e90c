"""Nothing of what is worn inside the body, and no skin through the cloth.

A simulation holds its own vertices and triangles outside. A finer surface that follows them cuts their corners, and a
thinned or coarser one its own: what is sharp on a body comes through between its vertices, as spots of skin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import concatenate, face_normals
from vto_pipeline.model.arrays import FloatArray, IntArray
from vto_pipeline.model.mesh import TriangleMesh
from vto_pipeline.model.render import GlbPart
from vto_pipeline.render.dress import BODY

_CLEAR = 0.0005
"""So far outside of the body garments are held [m]: more than the half step by which a file rounds."""

_ROUNDS = 8
"""Of moving vertices out of the body; in a crease one face's outside may be another's inside."""

_STEP, _RAISED = 0.001, 8
"""By how much [m], and how often at most, the corners of a face that still cuts the body are raised."""


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
    worn = [part.mesh for part in parts if part.name != BODY]
    cleared = iter(outside(worn, concatenate(bodies)))
    found = [
        part if part.name == BODY else replace(part, mesh=replace(part.mesh, vertices=next(cleared))) for part in parts
    ]
    pairs = zip(parts, found, strict=True)
    return found, sum(int((new.mesh.vertices != old.mesh.vertices).any(axis=1).sum()) for old, new in pairs)


def cut_by_body(parts: Sequence[GlbPart]) -> int:
    """Return how many triangles of what is worn pass through the body, of parts as `clear_body` takes them."""
    bodies = [part.mesh for part in parts if part.name == BODY]
    if not bodies:
        return 0
    body = concatenate(bodies)
    worn = [part.mesh for part in parts if part.name != BODY]
    return sum(len(np.unique(intersecting_faces(mesh, body)[:, 0])) for mesh in worn)


def outside(worn: Sequence[TriangleMesh], body: TriangleMesh) -> list[FloatArray]:
    """Return the vertices of meshes, each of shape (V, 3), moved as little as clears them of the body [m].

    First those inside the body or all but touching it go just outside. Where a face still cuts the body between its
    corners, these are raised step by step.
    """
    distance, outward = SurfaceDistance(body), face_normals(body)

    def push(vertices: FloatArray, which: IntArray, clear: FloatArray) -> None:
        for _ in range(_ROUNDS):
            found = distance.signed(vertices[which])
            close = found.distance < clear[which] - 0.5 * _CLEAR
            if not close.any():
                break
            which = which[close]
            vertices[which] = found.point[close] + clear[which, None] * outward[found.face[close]]

    cleared = []
    for mesh in worn:
        vertices, places = np.unique(mesh.vertices, axis=0, return_inverse=True)
        own: IntArray = places.reshape(-1).astype(np.int32)  # both sides of a seam of the picture move as one
        faces: IntArray = own[mesh.faces]
        clear = np.full(len(vertices), _CLEAR)
        push(vertices, np.arange(len(vertices), dtype=np.int32), clear)
        for _ in range(_RAISED):
            cut = intersecting_faces(TriangleMesh(vertices, faces), body)[:, 0]
            if len(cut) == 0:
                break
            corners = np.unique(faces[cut])
            clear[corners] += _STEP
            push(vertices, corners, clear)
        cleared.append(vertices[own])
    return cleared
