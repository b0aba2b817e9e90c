"""Constraints that resist deformation: one kind per file, listed here.

membrane/, bending/, points/: the kinds
kind, sweep: what a kind brings along, and the loops that serve all kinds
mass_spring: a sheet as structural, shear and bending springs (Provot 1995)
rigid: constraints without compliance
"""

from __future__ import annotations

from vto_pipeline.cloth.constraints.bending import bend_friction, hinge_moments, shape_operator
from vto_pipeline.cloth.constraints.bending import hinge as bend
from vto_pipeline.cloth.constraints.membrane import curve, green, strain_friction, strain_limit, stretch
from vto_pipeline.cloth.constraints.points import combination, spring

KINDS = (
    bend.KIND,
    bend_friction.KIND,
    combination.KIND,
    curve.KIND,
    green.KIND,
    hinge_moments.KIND,
    shape_operator.KIND,
    spring.KIND,
    strain_friction.KIND,
    strain_limit.KIND,
    stretch.KIND,
)
