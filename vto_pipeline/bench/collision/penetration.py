"""Penetration depth of a cloth in a collider, by independent formulas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vto_pipeline.cloth import Box, Capsule, Ellipsoid, MeshCollider, Moving, Plane, Sphere
from vto_pipeline.cloth.collision.shapes.pose import pose
from vto_pipeline.cloth.simulation import AnyCollider
from vto_pipeline.errors import InputError
from vto_pipeline.geometry.signed_distance import SurfaceDistance
from vto_pipeline.geometry.topology import edges
from vto_pipeline.model.arrays import FloatArray
from vto_pipeline.model.body import MovingBody
from vto_pipeline.model.mesh import TriangleMesh


class Penetration(NamedTuple):
    """What of a cloth is in a collider.

    Args:
        deepest: Of vertices, middles of edges and of faces; of all points in a ball [m]. Zero if none is inside.
        vertices: How many vertices are inside.
    """

    deepest: float
    vertices: int


def penetration(shape: AnyCollider, mesh: TriangleMesh, time: float) -> Penetration:
    """Return how deep a cloth is in a collider at a time [s]."""
    if isinstance(shape, Moving):
        own = shape.path.at(time).own(mesh.vertices)
        return penetration(shape.shape, TriangleMesh(own, mesh.faces), time)  # type: ignore[arg-type]
    x = mesh.vertices
    points = np.vstack([x, x[edges(mesh)].mean(axis=1), x[mesh.faces].mean(axis=1)])
    distance = _distance(shape, points)
    deepest = -float(distance.min())
    if isinstance(shape, Sphere):
        deepest = shape.radius - float(SurfaceDistance(mesh).nearest(np.array([shape.center])).distance[0])
    return Penetration(max(deepest, 0.0), int((distance[: len(x)] < 0.0).sum()))


def _distance(shape: AnyCollider, points: FloatArray) -> FloatArray:
    """Return signed distances [m], negative inside, shape (N,)."""
    match shape:
        case Sphere():
            return np.asarray(np.linalg.norm(points - shape.center, axis=1) - shape.radius)
        case Capsule():
            start, axis = np.array(shape.start), np.subtract(shape.end, shape.start)
            along = np.clip((points - start) @ axis / (axis @ axis), 0.0, 1.0)
            return np.asarray(np.linalg.norm(points - start - along[:, None] * axis, axis=1) - shape.radius)
        case Plane():
            return np.asarray((points - shape.point) @ shape.normal / np.linalg.norm(shape.normal))
        case Box():
            beyond = np.abs(pose(shape.center, shape.rotation).own(points)) - shape.half_sizes
            outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
            return np.asarray(outside + np.minimum(beyond.max(axis=1), 0.0))
        case MeshCollider() if isinstance(shape.mesh, TriangleMesh):
            return SurfaceDistance(shape.mesh).signed(points).distance
        case MeshCollider() | Ellipsoid() | MovingBody() | _:
            raise InputError(f"no distance to {type(shape).__name__} is known here")
