"""A lifelike body inside the avatar's surface wherever cloth covers it.

Cloth was draped on the avatar: on its plain head, hands and feet. Ears under a hood and fingers in a sleeve may stand
out further. There, and only there, they are drawn in to the avatar's surface, as ears lie flat under a hood.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.smooth import neighbour_mean
from vto_pipeline.geometry.topology import concatenate, face_normals
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.mesh import TriangleMesh

_OWN_M = 1e-4
"""A vertex nearer than this to the avatar's surface is the avatar's own."""
_BELOW_M = 0.0015
"""How far under the avatar's surface a covered vertex is drawn."""
_COVERED_M, _BARE_M = 0.008, 0.025
"""Distances to cloth at which a vertex is drawn in altogether, and not at all."""
_STOPS = np.linspace(0.0, 1.0, 5)
"""Where cloth is looked for, from the avatar's surface to the vertex."""
_ROUNDS = 3
"""Of spreading to neighbours, so that nothing is torn at an edge of cloth."""


def tuck(body: TriangleMesh, avatar: TriangleMesh, cloth: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return the lifelike body with what cloth covers drawn in.

    Args:
        body: Lifelike, in the avatar's pose [m].
        avatar: What the cloth was draped on [m].
        cloth: As it lies on the avatar [m].
    """
    if not cloth:
        return body
    surface, outward = SurfaceDistance(avatar), face_normals(avatar)
    found = surface.signed(body.vertices)
    out = np.flatnonzero(found.distance > _OWN_M)
    start, end = found.point[out], body.vertices[out]
    cover = SurfaceDistance(concatenate([TriangleMesh(one.vertices, one.faces) for one in cloth]))
    away = np.min([cover.nearest(start + share * (end - start)).distance for share in _STOPS], axis=0)
    share = np.zeros(len(body.vertices))
    share[out] = _fading(away)
    mean = neighbour_mean(body)
    for _ in range(_ROUNDS):
        share = np.maximum(share, mean @ share)
    inner = start - _BELOW_M * outward[found.face[out]]
    vertices = np.array(body.vertices)
    vertices[out] = end + share[out, None] * (inner - end)
    return TriangleMesh(vertices, body.faces, body.colors)


def innermost(bodies: Sequence[TriangleMesh], normals: FloatArray) -> TriangleMesh:
    """Return one body of several that were tucked under a garment each: every vertex as the furthest in has it.

    Args:
        bodies: Of one topology, at least one.
        normals: Of the body, outward, shape (V, 3).
    """
    depth = np.stack([(body.vertices * normals).sum(axis=1) for body in bodies])
    every = np.stack([body.vertices for body in bodies])
    return TriangleMesh(every[depth.argmin(axis=0), np.arange(len(normals))], bodies[0].faces, bodies[0].colors)


def _fading(away: FloatArray) -> FloatArray:
    """Return 1 up to the distance of covered skin, 0 from that of bare skin on, smooth between."""
    share = np.clip((_BARE_M - away) / (_BARE_M - _COVERED_M), 0.0, 1.0)
    return share * share * (3 - 2 * share)
