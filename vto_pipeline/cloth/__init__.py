"""Cloth: model, constraints, solvers, contacts, and the drape."""

from __future__ import annotations

from vto_pipeline.cloth.collision.shapes import Capsule, MeshCollider, Plane, Sphere
from vto_pipeline.cloth.simulation import Trajectory, simulate

__all__ = ["Capsule", "MeshCollider", "Plane", "Sphere", "Trajectory", "simulate"]
