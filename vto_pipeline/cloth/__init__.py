"""Cloth: model, constraints, solvers, contacts, and the drape."""

from __future__ import annotations

from vto_pipeline.cloth.collision.moving import Moving
from vto_pipeline.cloth.collision.pose import Path
from vto_pipeline.cloth.collision.shapes import Box, Capsule, Ellipsoid, MeshCollider, Plane, Sphere
from vto_pipeline.cloth.simulation import Trajectory, simulate

__all__ = [
    "Box",
    "Capsule",
    "Ellipsoid",
    "MeshCollider",
    "Moving",
    "Path",
    "Plane",
    "Sphere",
    "Trajectory",
    "simulate",
]
