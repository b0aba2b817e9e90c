"""A body with its garments as one solid, for the next layer.

The garments beneath are frozen with some room about them, and the air between them and the body is filled: cloth that
is to come over them then has one way to go, out, and can be put there by the very means that put it about a body.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vto_pipeline.geometry.intersections import intersecting_faces
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import close_openings, concatenate, vertex_normals
from vto_pipeline.model.mesh import TriangleMesh

_ROOM = 5e-3  # m kept about body and cloth
_CUBE = 1e-2  # m: where the distance is sampled
_FINER = 0.7  # of the cube: where cloth shows through the solid, it is made again with smaller ones
_FINEST = 4e-3  # m


def wrap_in_surface(body: TriangleMesh, worn: Sequence[TriangleMesh]) -> TriangleMesh:
    """Return the surface at a small distance around a body and the garments on it, closed and oriented outward.

    Args:
        body: At rest [m].
        worn: Garments on it [m]; each is closed at its openings, so that what is inside a sleeve or a leg is inside.
    """
    import igl

    solids = [body, *(close_openings(_outward(garment, body)) for garment in worn)]
    whole = concatenate(solids)
    vertices, faces = np.array(whole.vertices), whole.faces.astype(np.int64)
    longest, cube = float(np.ptp(vertices, axis=0).max()), _CUBE
    kind = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    while True:
        around = igl.offset_surface(vertices, faces, _ROOM, int(np.ceil(longest / cube)), kind)
        solid = TriangleMesh(around[0], around[1].astype(np.int32))
        cube *= _FINER
        if cube < _FINEST or not any(len(intersecting_faces(garment, solid)) for garment in worn):
            return solid


def _outward(garment: TriangleMesh, body: TriangleMesh) -> TriangleMesh:
    """Return a garment with its faces oriented away from the body, by the majority of its area."""
    away = garment.vertices - SurfaceDistance(body).nearest(garment.vertices).point
    facing = np.einsum("vi,vi->v", vertex_normals(garment), away)
    return garment if facing.sum() >= 0.0 else TriangleMesh(garment.vertices, garment.faces[:, ::-1])
