"""Cloth: model, constraints, solvers, contacts, and the drape.

drape, drape_config: a garment on a body, at rest
simulation: cloth among simple colliders, from Python
model/, constraints/: what a cloth is, and what resists its deformation
solvers/, integrators/, implicit_step/, dynamics/: the ways to move it on in time
collision/, untangle/: contact, and starts that pass through themselves
placement/, rest/: from where a garment was to a clean start; from there to rest
rest_shape/, outfit/: shape without forces; several garments
swatch/: a fabric's rigidity from strips that hang
moving/: a draped garment on a body that moves
judge/: what is true of the result, by formulas of its own
"""

from __future__ import annotations

from vto_pipeline.cloth.collision.shapes.colliders import Box, Capsule, Ellipsoid, MeshCollider, Plane, Sphere
from vto_pipeline.cloth.collision.shapes.moving import Moving
from vto_pipeline.cloth.collision.shapes.pose import Path
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
